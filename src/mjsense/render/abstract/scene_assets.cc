// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/scene_assets.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <span>
#include <utility>

namespace mjsense::render {
namespace {

// Only what the model's height fields or skins need.
mjModel part_of(const mjModel* model, bool height_fields) {
  mjModel part = *model;
  part.nmesh = part.ntex = 0;
  (height_fields ? part.nskin : part.nhfield) = 0;
  return part;
}

}  // namespace

SceneAssets::SceneAssets(const mjModel* model)
    : model_(model),
      mesh_stamps_(model->nmesh),
      texture_stamps_(model->ntex),
      height_field_stamps_(model->nhfield) {
  reload();
  reload_changed();
}

bool SceneAssets::Stamp::changed(const void* data, std::size_t bytes) {
  const auto* at = static_cast<const unsigned char*>(data);
  const std::size_t words = bytes / sizeof(std::uint64_t);
  const std::size_t step = std::max<std::size_t>(1, words / kPlaces);
  std::uint64_t hash = bytes;
  for (std::size_t i = 0; i < words; i += step) {
    std::uint64_t word;
    std::memcpy(&word, at + i * sizeof word, sizeof word);
    hash = std::rotl((hash ^ word) * 0x9E3779B97F4A7C15u, 29);
  }
  for (std::size_t i = words * sizeof(std::uint64_t); i < bytes; ++i) hash = hash * 31 + at[i];
  return std::exchange(value, hash) != hash;
}

void SceneAssets::reload_changed() {
  improved_ = false;
  const mjModel* m = model_;
  for (int i = 0; i < m->nmesh; ++i) {
    if (!mesh_stamps_[i].changed(m->mesh_vert + 3 * m->mesh_vertadr[i],
                                 3 * sizeof(float) * m->mesh_vertnum[i]))
      continue;
    meshes_[2 * i].reset();
    meshes_[2 * i + 1].reset();
  }
  for (int i = 0; i < m->ntex; ++i) {
    const std::size_t bytes =
        static_cast<std::size_t>(m->tex_width[i]) * m->tex_height[i] * m->tex_nchannel[i];
    if (texture_stamps_[i].changed(m->tex_data + m->tex_adr[i], bytes)) textures_[i].reset();
  }
  for (int i = 0; i < m->nhfield; ++i) {
    const std::size_t values = static_cast<std::size_t>(m->hfield_nrow[i]) * m->hfield_ncol[i];
    if (height_field_stamps_[i].changed(m->hfield_data + m->hfield_adr[i], values * sizeof(float)))
      height_fields_.reset();
  }
}

void SceneAssets::reload() {
  meshes_.clear();
  meshes_.resize(2 * model_->nmesh);
  textures_.assign(model_->ntex, nullptr);
  height_fields_.reset();
  skins_.reset();
}

const DrawnMesh* SceneAssets::mesh(int id) {
  std::unique_ptr<DrawnMesh>& place = meshes_[id];
  if (!place) {
    const mjModel* m = model_;
    const int mesh = id / 2;
    DrawnMesh made;
    if (id % 2) {
      made = hull(mesh);
    } else if (m->mesh_facenum[mesh] > 0) {
      made.geometry = geometry(mesh, true, rays::BuildQuality::kFast);
      made.tables = mesh_tables(m, mesh);
    }
    if (made.tables) made.surface = made.tables->surface();
    place = std::make_unique<DrawnMesh>(std::move(made));
  }
  if (!place->geometry || !place->geometry->scene) return nullptr;
  if (id % 2 == 0 && !place->shadows && !improved_ && ++place->uses > kManyUses) {
    place->shadows = geometry(id / 2, false, rays::BuildQuality::kHigh);
    improved_ = true;
  }
  return place.get();
}

std::shared_ptr<const rays::MeshGeometry> SceneAssets::geometry(int mesh, bool clusters,
                                                                rays::BuildQuality quality) const {
  const mjModel* m = model_;
  return rays::mesh_geometry({m->mesh_vert + 3 * m->mesh_vertadr[mesh],
                              3 * static_cast<std::size_t>(m->mesh_vertnum[mesh])},
                             {m->mesh_face + 3 * m->mesh_faceadr[mesh],
                              3 * static_cast<std::size_t>(m->mesh_facenum[mesh])},
                             clusters, quality);
}

// The faces of MuJoCo's convex hull, shaded flat.
DrawnMesh SceneAssets::hull(int mesh) const {
  const mjModel* m = model_;
  if (m->mesh_graphadr[mesh] < 0) return {};
  const int* graph = m->mesh_graph + m->mesh_graphadr[mesh];
  const int num_vertices = graph[0], num_faces = graph[1];
  const std::span<const int> faces(graph + 2 + 3 * num_vertices + 3 * num_faces,
                                   3 * static_cast<std::size_t>(num_faces));
  const float* vert = m->mesh_vert + 3 * m->mesh_vertadr[mesh];
  DrawnMesh made;
  made.geometry = rays::mesh_geometry({vert, 3 * static_cast<std::size_t>(m->mesh_vertnum[mesh])},
                                      faces, true, rays::BuildQuality::kFast);
  auto tables = std::make_shared<MeshTables>();
  for (int f = 0; f < num_faces; ++f) {
    const float *a = vert + 3 * faces[3 * f], *b = vert + 3 * faces[3 * f + 1],
                *c = vert + 3 * faces[3 * f + 2];
    float n[3], length = 0;
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      n[k] = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i]);
      length += n[k] * n[k];
    }
    for (int corner = 0; corner < 3; ++corner)
      for (float x : n) tables->normals.push_back(length > 0 ? x / std::sqrt(length) : 0);
  }
  if (m->mesh_texcoordadr[mesh] >= 0) {
    const float* texcoord = m->mesh_texcoord + 2 * m->mesh_texcoordadr[mesh];
    add_coordinates(*tables, num_faces, vert, faces.data(), texcoord, faces.data());
  }
  made.tables = std::move(tables);
  return made;
}

const Texture* SceneAssets::texture(int id) {
  if (id < 0 || id >= model_->ntex) return nullptr;
  if (!textures_[id]) textures_[id] = stored_texture(model_, id);
  return textures_[id]->texture.levels > 0 ? &textures_[id]->texture : nullptr;
}

const Texture* SceneAssets::skybox() {
  for (int i = 0; i < model_->ntex; ++i)
    if (model_->tex_type[i] == mjTEXTURE_SKYBOX) return texture(i);
  return nullptr;
}

const rays::HeightField& SceneAssets::height_field(int id) {
  if (!height_fields_) {
    const mjModel part = part_of(model_, true);
    height_fields_ = std::make_unique<rays::SharedGeometry>(&part);
  }
  return height_fields_->height_fields[id];
}

const MeshSurface& SceneAssets::skin(int id) {
  if (!skins_) {
    const mjModel part = part_of(model_, false);
    skins_ = std::make_unique<SurfaceAssets>(&part, false, true);
  }
  return *skins_->skin(id);
}

}  // namespace mjsense::render
