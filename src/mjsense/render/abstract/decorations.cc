// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/decorations.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <utility>

#include "mjsense/render/abstract/shape_box.h"

namespace mjsense::render {

void Decorations::add(const DrawnGeom& like, ShapeTriangles triangles,
                      std::vector<DrawnGeom>& out) {
  if (triangles.faces.empty()) return;
  Decoration& d = *all_.emplace_back(std::make_unique<Decoration>());
  d.triangles = std::move(triangles);
  d.scene = rays::build_triangles(device_.get(), d.triangles.vertices, d.triangles.faces,
                                  rays::BuildQuality::kFast);
  d.surface.normals = d.triangles.normals.data();
  rays::box_around(d.triangles.vertices, d.box);
  DrawnGeom& drawn = out.emplace_back(like);
  set_box(d.box, drawn.shape);
  drawn.bvh = d.scene.get();
  drawn.mesh = &d.surface;
  drawn.texture = nullptr;
}

// The triangles of lines have no normal, so that only the lights' ambient parts reach them; emission
// makes up for the rest of the colour.
void Decorations::add_lines(const AbstractGeom& geom, const DrawnGeom& like,
                            const SceneCamera& camera, float line_width, float ambient,
                            std::vector<DrawnGeom>& out) {
  DrawnGeom drawn = like;
  const double* r = drawn.shape.mat;
  float eye[3], ahead[3];
  for (int i = 0; i < 3; ++i) {
    eye[i] = ahead[i] = 0;
    for (int k = 0; k < 3; ++k) {
      eye[i] += static_cast<float>(r[3 * k + i] * (camera.position[k] - drawn.shape.pos[k]));
      ahead[i] += static_cast<float>(r[3 * k + i] * -camera.rotation[3 * k + 2]);
    }
  }
  ShapeTriangles triangles;
  const auto line = [&](const float* from, const float* to, float width) {
    add_line(from, to, eye, ahead, camera.grid.orthographic, width, camera.grid.dx, triangles);
  };
  const float* s = geom.size;
  if (geom.type == mjGEOM_LINE) {
    const float from[3] = {0, 0, 0}, to[3] = {0, 0, s[2]};
    line(from, to, s[0] * line_width);
  } else {
    for (int corner = 0; corner < 8; ++corner) {
      for (int axis = 0; axis < 3; ++axis) {
        if (corner >> axis & 1) continue;
        float from[3], to[3];
        for (int k = 0; k < 3; ++k) from[k] = to[k] = corner >> k & 1 ? s[k] : -s[k];
        to[axis] = s[axis];
        line(from, to, 1.5f * line_width);
      }
    }
  }
  drawn.material.emission = std::max(0.0f, 1 - ambient);
  drawn.material.specular = 0;
  add(drawn, std::move(triangles), out);
}

}  // namespace mjsense::render
