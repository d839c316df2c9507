// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/drawn_mesh.h"

#include <cmath>

#include "mjsense/core/model_indices.h"

namespace mjsense::render {

DrawnMesh::DrawnMesh(const mjModel* m, int id, bool& improved)
    : model_(m), mesh_(id / 2), hull_(id % 2 != 0), improved_(improved) {
  check_mesh_indices(*m, mesh_);
  const auto part = [](auto* all, int begin, int count) {
    return std::span(all + 3 * static_cast<std::size_t>(begin),
                     3 * static_cast<std::size_t>(count));
  };
  vertices_ = part(m->mesh_vert, m->mesh_vertadr[mesh_], m->mesh_vertnum[mesh_]);
  if (!hull_) {
    faces_ = part(m->mesh_face, m->mesh_faceadr[mesh_], m->mesh_facenum[mesh_]);
  } else if (m->mesh_graphadr[mesh_] >= 0) {
    // MuJoCo's convex hull: the numbers of vertices and faces, three arrays, the faces.
    const int* graph = m->mesh_graph + m->mesh_graphadr[mesh_];
    faces_ = part(graph + 2, graph[0] + graph[1], graph[1]);
  }
  rays::box_around(vertices_, box_.data());
}

void DrawnMesh::begin_image() {
  arrays_.reset();
  used_ = false;
}

const rays::MeshArrays& DrawnMesh::arrays() {
  if (!arrays_) {
    check_mesh_indices(*model_, mesh_);  // the program may have written them since the last image
    arrays_.emplace(vertices_, faces_);
  }
  return *arrays_;
}

const rays::Clusters& DrawnMesh::clusters() {
  if (!clusters_) clusters_ = rays::mesh_clusters(arrays());
  return *clusters_;
}

const rays::Horizons& DrawnMesh::horizons() {
  if (!horizons_) horizons_ = rays::mesh_horizons(arrays());
  return *horizons_;
}

void* DrawnMesh::bvh() {
  if (!tree_) tree_ = rays::mesh_scene(arrays(), rays::BuildQuality::kFast);
  return tree_->scene.get();
}

void* DrawnMesh::shadow_bvh() {
  if (!hull_ && !better_tree_ && !used_ && ++uses_ > kManyUses && !improved_) {
    better_tree_ = rays::mesh_scene(arrays(), rays::BuildQuality::kHigh);
    improved_ = true;
  }
  used_ = true;
  return better_tree_ ? better_tree_->scene.get() : bvh();
}

bool DrawnMesh::has_uvs() const { return model_->mesh_texcoordadr[mesh_] >= 0; }

void DrawnMesh::prepare_surface(bool coordinates) {
  if (tables_ && (surface_.uvs || !coordinates || !has_uvs())) return;
  check_mesh_indices(*model_, mesh_);
  tables_ = hull_ ? hull_tables(coordinates) : mesh_tables(model_, mesh_, coordinates);
  surface_ = tables_->surface(vertices_.data(), faces_.data());
}

// Hulls are shaded flat.
std::shared_ptr<const MeshTables> DrawnMesh::hull_tables(bool coordinates) const {
  auto tables = std::make_shared<MeshTables>();
  const float* vert = vertices_.data();
  const int num_faces = static_cast<int>(faces_.size() / 3);
  for (int f = 0; f < num_faces; ++f) {
    const float *a = vert + 3 * faces_[3 * f], *b = vert + 3 * faces_[3 * f + 1],
                *c = vert + 3 * faces_[3 * f + 2];
    float n[3], length = 0;
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      n[k] = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i]);
      length += n[k] * n[k];
    }
    for (int corner = 0; corner < 3; ++corner)
      for (float x : n) tables->normals.push_back(length > 0 ? x / std::sqrt(length) : 0);
  }
  if (coordinates && has_uvs())
    tables->add_coordinates(model_->mesh_texcoord + 2 * model_->mesh_texcoordadr[mesh_], faces_);
  return tables;
}

}  // namespace mjsense::render
