// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/soft_geoms.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <span>

#include "mjsense/render/abstract/shape_box.h"

namespace mjsense::render {
namespace {

// Makes `shape` the cylinder from a to b. Returns false if they are the same point.
bool set_cylinder(const float a[3], const float b[3], float radius, rays::RayGeom& shape) {
  double along[3], length = 0;
  for (int k = 0; k < 3; ++k) {
    along[k] = b[k] - a[k];
    length += along[k] * along[k];
    shape.pos[k] = 0.5 * (static_cast<double>(a[k]) + b[k]);
  }
  length = std::sqrt(length);
  if (!(length > 0)) return false;
  double* m = shape.mat;
  for (double& x : along) x /= length;
  const int minimum = std::abs(along[0]) < 0.5 ? 0 : 1;
  double x[3] = {}, size = 0;
  for (int k = 0; k < 3; ++k) x[k] = (k == minimum) - along[minimum] * along[k];
  for (double v : x) size += v * v;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    m[3 * k] = x[k] / std::sqrt(size);
    m[3 * k + 1] = (along[i] * x[j] - along[j] * x[i]) / std::sqrt(size);
    m[3 * k + 2] = along[k];
  }
  std::copy_n(m, 9, shape.rot);
  shape.size[0] = radius;
  shape.size[1] = static_cast<float>(0.5 * length);
  shape.size[2] = 0;
  set_box(radius, radius, shape.size[1], shape);
  return true;
}

// The geom of triangles in the world frame.
DrawnGeom drawn_soft(const DrawnGeom& like, std::span<const float, 6> box, void* bvh,
                     const MeshSurface* surface) {
  DrawnGeom drawn = like;
  set_box(box, drawn.shape);
  std::fill_n(drawn.shape.pos, 3, 0.0);
  set_unrotated(drawn.shape);
  drawn.bvh = bvh;
  drawn.mesh = surface;
  return drawn;
}

}  // namespace

void SoftGeoms::add_flex(const AbstractGeom& geom, const DrawnGeom& like, const SceneMemory& scene,
                         std::vector<DrawnGeom>& out) {
  const int id = geom.objid;
  if (id < 0 || id >= arrays_.num_flexes) return;
  const int used = arrays_.flexfaceused[id];
  const float radius = geom.size[0];
  if (radius > 0 && !(scene.flex_skin && used)) add_flex_frame(id, radius, like, scene, out);
  // One material of several: size holds its range of faces.
  const bool slice = geom.dataid >= 0 && geom.size[2] > 0;
  const int first = slice ? static_cast<int>(geom.size[1]) : 0;
  const int count = slice ? static_cast<int>(geom.size[2]) : used;
  if (count > 0) add_flex_faces(id, first, count, geom.texcoord && like.texture, like, out);
}

// Spheres at the vertices and cylinders along the edges.
void SoftGeoms::add_flex_frame(int id, float radius, const DrawnGeom& like,
                               const SceneMemory& scene, std::vector<DrawnGeom>& out) const {
  DrawnGeom part = like;
  part.texture = nullptr;
  const float* vertices = arrays_.flexvert + 3 * arrays_.flexvertadr[id];
  if (scene.flex_vertices) {
    part.shape.type = mjGEOM_SPHERE;
    std::fill_n(part.shape.size, 3, radius);
    set_box(radius, radius, radius, part.shape);
    for (int v = 0; v < arrays_.flexvertnum[id]; ++v) {
      std::copy_n(vertices + 3 * v, 3, part.shape.pos);
      out.push_back(part);
    }
  }
  if (!scene.flex_edges) return;
  part.shape.type = mjGEOM_CYLINDER;
  const int* edge = arrays_.flexedge + 2 * arrays_.flexedgeadr[id];
  for (int e = 0; e < arrays_.flexedgenum[id]; ++e, edge += 2) {
    if (set_cylinder(vertices + 3 * edge[0], vertices + 3 * edge[1], radius, part.shape))
      out.push_back(part);
  }
}

void SoftGeoms::add_flex_faces(int id, int first, int count, bool has_uvs, const DrawnGeom& like,
                               std::vector<DrawnGeom>& out) {
  const std::size_t start = arrays_.flexfaceadr[id] + first;
  std::unique_ptr<Soft>& place = flexes_[{id, first}];
  const std::span<const float> now(arrays_.flexface + 9 * start,
                                   9 * static_cast<std::size_t>(count));
  if (!place || place->num_faces != count) {
    place = std::make_unique<Soft>();
    place->num_faces = count;
    place->faces.resize(3 * static_cast<std::size_t>(count));
    std::iota(place->faces.begin(), place->faces.end(), 0);
    place->mesh = rays::DeformableMesh(device_.get(), place->faces, now);
    rays::box_around(now, place->box);
  } else if (!std::ranges::equal(now, place->mesh.vertices())) {
    std::ranges::copy(now, place->mesh.vertices().begin());
    place->mesh.refit();
    rays::box_around(now, place->box);
  }
  Soft& soft = *place;
  soft.surface = {.normals = arrays_.flexnormal + 9 * start,
                  .uvs = has_uvs ? arrays_.flextexcoord + 6 * start : nullptr,
                  .positions = soft.mesh.vertices().data(),
                  .faces = soft.faces.data()};
  out.push_back(drawn_soft(like, soft.box, soft.mesh.scene(), &soft.surface));
}

void SoftGeoms::add_skin(const AbstractGeom& geom, const DrawnGeom& like,
                         std::vector<DrawnGeom>& out) {
  const int id = geom.objid;
  if (id < 0 || id >= model_->nskin || model_->skin_facenum[id] == 0) return;
  const std::span<const float> now(arrays_.skinvert + 3 * arrays_.skinvertadr[id],
                                   3 * static_cast<std::size_t>(arrays_.skinvertnum[id]));
  const float* normals = arrays_.skinnormal + 3 * arrays_.skinvertadr[id];
  const int num_faces = model_->skin_facenum[id];
  const int* faces = model_->skin_face + 3 * model_->skin_faceadr[id];
  std::unique_ptr<Soft>& place = skins_[id];
  const bool first = !place;
  if (first) {
    place = std::make_unique<Soft>();
    place->mesh =
        rays::DeformableMesh(device_.get(), {faces, 3 * static_cast<std::size_t>(num_faces)}, now);
    place->normals.resize(9 * static_cast<std::size_t>(num_faces));
  }
  Soft& soft = *place;
  if (first || !std::ranges::equal(now, soft.mesh.vertices())) {
    std::ranges::copy(now, soft.mesh.vertices().begin());
    if (!first) soft.mesh.refit();
    rays::box_around(now, soft.box);
    for (int i = 0; i < 3 * num_faces; ++i)
      std::copy_n(normals + 3 * faces[i], 3, &soft.normals[3 * static_cast<std::size_t>(i)]);
  }
  soft.surface = {soft.normals.data(), assets_.skin(id).uvs, soft.mesh.vertices().data(), faces};
  out.push_back(drawn_soft(like, soft.box, soft.mesh.scene(), &soft.surface));
}

}  // namespace mjsense::render
