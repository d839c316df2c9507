// SPDX-License-Identifier: Apache-2.0
#pragma once
// The decoration geoms of one abstract scene that are drawn as triangles (decoration_shapes.h).

#include <memory>
#include <vector>

#include "mjsense/rays/mesh_geometry.h"
#include "mjsense/render/abstract/abstract_scene.h"
#include "mjsense/render/abstract/decoration_shapes.h"
#include "mjsense/render/abstract/scene_camera.h"
#include "mjsense/render/view/drawn_scene.h"

namespace mjsense::render {

// Owns the triangles of the geoms that it makes.
class Decorations {
 public:
  Decorations() : device_(rays::ray_device()) {}

  void clear() { all_.clear(); }
  // Appends the geom to `out`, unless it has no triangles. `like`: its material and pose.
  void add(const DrawnGeom& like, ShapeTriangles triangles, std::vector<DrawnGeom>& out);
  // Adds a geom of type mjGEOM_LINE or mjGEOM_LINEBOX. Lines are not lit: `ambient` is the light that
  // reaches them all the same.
  void add_lines(const AbstractGeom& geom, const DrawnGeom& like, const SceneCamera& camera,
                 float line_width, float ambient, std::vector<DrawnGeom>& out);

 private:
  struct Decoration {
    ShapeTriangles triangles;
    rays::SceneHandle scene;
    MeshSurface surface;
    float box[6];
  };
  std::shared_ptr<RTCDeviceTy> device_;
  std::vector<std::unique_ptr<Decoration>> all_;
};

}  // namespace mjsense::render
