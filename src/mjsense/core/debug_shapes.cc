// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/debug_shapes.h"

#include <cstdio>
#include <utility>

namespace mjsense {

void DebugShapes::add_sphere(Vec3 center, double radius, const Rgba& rgba, std::string label) {
  list_.push_back({mjGEOM_SPHERE, center, {}, radius, rgba, std::move(label)});
}

void DebugShapes::add_arrow(Vec3 from, Vec3 to, double width, const Rgba& rgba, std::string label) {
  list_.push_back({mjGEOM_ARROW, from, to - from, width, rgba, std::move(label)});
}

void DebugShapes::add_line(Vec3 from, Vec3 to, double pixels, const Rgba& rgba, std::string label) {
  list_.push_back({mjGEOM_LINE, from, to - from, pixels, rgba, std::move(label)});
}

void DebugShapes::add_frame(Vec3 origin, const double mat[9], double length, double width,
                            const std::string& label) {
  static constexpr Rgba kColors[3] = {{0.9f, 0, 0, 1}, {0, 0.9f, 0, 1}, {0, 0, 0.9f, 1}};
  for (int k = 0; k < 3; ++k) {
    const Vec3 axis{mat[k], mat[3 + k], mat[6 + k]};
    add_arrow(origin, origin + length * axis, width, kColors[k], label + "_" + "xyz"[k]);
  }
}

int DebugShapes::append_to(mjvScene* scene, bool labels) const {
  int left_out = 0;
  for (const DebugShape& shape : list_) {
    if (scene->ngeom >= scene->maxgeom) {
      ++left_out;
      continue;
    }
    mjvGeom* g = scene->geoms + scene->ngeom++;
    double pos[3], to[3];
    write_vec(shape.pos, pos);
    write_vec(shape.pos + shape.vector, to);
    const double size[3] = {shape.width, shape.width, shape.width};
    mjv_initGeom(g, shape.kind, size, pos, nullptr, shape.rgba.data());
    if (shape.kind != mjGEOM_SPHERE) mjv_connector(g, shape.kind, shape.width, pos, to);
    g->category = mjCAT_DECOR;
    if (labels) std::snprintf(g->label, sizeof g->label, "%s", shape.label.c_str());
  }
  return left_out;
}

}  // namespace mjsense
