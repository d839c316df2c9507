// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/object_shape.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::episode {
namespace {

using std::numbers::pi;

int steps(double length, double spacing) {
  return std::max(1, static_cast<int>(std::ceil(length / spacing)));
}

void sample_box(Vec3 half, double spacing, std::vector<Vec3>& out) {
  const double h[3] = {half.x, half.y, half.z};
  for (int axis = 0; axis < 3; ++axis) {
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    const int na = steps(2 * h[a], spacing), nb = steps(2 * h[b], spacing);
    for (int side = -1; side <= 1; side += 2) {
      for (int i = 0; i <= na; ++i) {
        for (int j = 0; j <= nb; ++j) {
          double p[3];
          p[axis] = side * h[axis];
          p[a] = h[a] * (2.0 * i / na - 1.0);
          p[b] = h[b] * (2.0 * j / nb - 1.0);
          out.push_back(vec3(p));
        }
      }
    }
  }
}

void sample_ring(double radius, double z, double spacing, std::vector<Vec3>& out) {
  const int n = radius > 0 ? std::max(8, steps(2 * pi * radius, spacing)) : 1;
  for (int i = 0; i < n; ++i) {
    const double a = 2 * pi * i / n;
    out.push_back({radius * std::cos(a), radius * std::sin(a), z});
  }
}

// Samples a cylinder of half height h between two half ellipsoids of polar radius `cap` (0: flat
// discs).
void sample_round(Vec3 radius, double h, double cap, double spacing, std::vector<Vec3>& out) {
  std::vector<Vec3> unit;
  const double r = std::max(radius.x, radius.y);
  const int n = steps(cap > 0 ? 0.5 * pi * std::max(r, cap) : r, spacing);
  for (int i = 0; i <= n; ++i) {
    const double a = 0.5 * pi * i / n;
    const double ring = cap > 0 ? std::cos(a) : static_cast<double>(i) / n;
    const double z = h + (cap > 0 ? cap * std::sin(a) : 0.0);
    sample_ring(ring * r, z, spacing, unit);
    sample_ring(ring * r, -z, spacing, unit);
  }
  const int m = steps(2 * h, spacing);
  for (int i = 1; i < m; ++i) sample_ring(r, h * (2.0 * i / m - 1.0), spacing, unit);
  for (Vec3 p : unit) out.push_back({p.x * radius.x / r, p.y * radius.y / r, p.z});
}

void sample_mesh(const mjModel* model, int mesh, double spacing, std::vector<Vec3>& out) {
  const float* vertices = model->mesh_vert + 3 * model->mesh_vertadr[mesh];
  const int* faces = model->mesh_face + 3 * model->mesh_faceadr[mesh];
  for (int f = 0; f < model->mesh_facenum[mesh]; ++f) {
    Vec3 v[3];
    for (int k = 0; k < 3; ++k) {
      const float* p = vertices + 3 * faces[3 * f + k];
      v[k] = {p[0], p[1], p[2]};
    }
    const Vec3 a = v[1] - v[0], b = v[2] - v[0];
    const int n = steps(std::max({norm(a), norm(b), norm(b - a)}), spacing);
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; j <= n - i; ++j)
        out.push_back(v[0] + (static_cast<double>(i) / n) * a + (static_cast<double>(j) / n) * b);
    }
  }
}

void sample_geom(const mjModel* model, int geom, double spacing, std::vector<Vec3>& out) {
  const double* size = model->geom_size + 3 * geom;
  switch (model->geom_type[geom]) {
    case mjGEOM_BOX:
      return sample_box(vec3(size), spacing, out);
    case mjGEOM_SPHERE:
      return sample_round({size[0], size[0], size[0]}, 0, size[0], spacing, out);
    case mjGEOM_ELLIPSOID:
      return sample_round(vec3(size), 0, size[2], spacing, out);
    case mjGEOM_CAPSULE:
      return sample_round({size[0], size[0], size[0]}, size[1], size[0], spacing, out);
    case mjGEOM_CYLINDER:
      return sample_round({size[0], size[0], 0}, size[1], 0, spacing, out);
    case mjGEOM_MESH:
      return sample_mesh(model, model->geom_dataid[geom], spacing, out);
    default:
      throw ValueError(fmt::format("object '{}': geoms of this type cannot be picked up",
                                   scene::name_of(model, mjOBJ_BODY, model->geom_bodyid[geom])));
  }
}

}  // namespace

ObjectShape object_shape(const mjModel* model, int body, double spacing) {
  ObjectShape shape;
  for (int g = 0; g < model->ngeom; ++g) {
    const int own = model->geom_bodyid[g];
    if (!is_solid(model, g) || !observe::is_descendant_or_self(model, own, body)) continue;
    const Pose pose = in_ancestor(model, {}, own, body) * geom_frame(model, g);
    std::vector<Vec3> local;
    sample_geom(model, g, spacing, local);
    for (Vec3 p : local) shape.points.push_back(pose * p);
  }
  if (shape.points.empty()) {
    throw ValueError(
        fmt::format("object '{}': has no collision geom", scene::name_of(model, mjOBJ_BODY, body)));
  }
  shape.low = shape.high = shape.points.front().z;
  for (Vec3 p : shape.points) {
    shape.low = std::min(shape.low, p.z);
    shape.high = std::max(shape.high, p.z);
    shape.radius = std::max(shape.radius, std::hypot(p.x, p.y));
    shape.reach = std::max(shape.reach, norm(p));
  }
  return shape;
}

ObjectShape scaled(const ObjectShape& shape, double size) {
  ObjectShape out;
  out.points.reserve(shape.points.size());
  for (Vec3 p : shape.points) out.points.push_back(size * p);
  out.low = size * shape.low;
  out.high = size * shape.high;
  out.radius = size * shape.radius;
  out.reach = size * shape.reach;
  return out;
}

}  // namespace mjsense::tasks::episode
