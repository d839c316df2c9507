// SPDX-License-Identifier: Apache-2.0
#pragma once
// Flexes of one world: their surfaces (flex_surface.h) at the current vertex positions. Coordinates
// are relative to the flex's first vertex (world axes), so that single precision is sufficient
// anywhere in the world.

#include <mujoco/mujoco.h>

#include <span>
#include <vector>

#include "mjsense/rays/deformable_mesh.h"
#include "mjsense/rays/flex_surface.h"

namespace mjsense::rays {

class FlexShapes {
 public:
  // `surfaces` is indexed by flex id and must outlive this object.
  FlexShapes(RTCDevice device, std::span<const FlexSurface> surfaces, const mjModel* model);

  // Copies the world's vertices and radii. A flex that did not move costs only a comparison.
  void update(const mjModel* model, const mjData* data);

  // m, world frame
  std::span<const double> vertices(int flex) const { return flexes_[flex].vertices; }
  // m, world frame
  const double* position(int flex) const { return flexes_[flex].vertices.data(); }
  // [6] centre and half sizes of the flex's bounding box, m.
  const float* box(int flex) const { return flexes_[flex].box; }
  // RTCScene by flex id, for rays; null if the flex has no surface.
  void* const* scenes() const { return scenes_.data(); }

  // Parts of flexes that cameras draw, in the order of flex_parts().
  struct Part {
    int flex, element;  // `element`: the element whose material the part has
    int material;       // id or -1
    void* scene;        // RTCScene; null: nothing to draw
    // [faces, 3 corners, 3] unit; null for dimension 1, and if the model has no cameras.
    const float* normals;
    const float* positions;  // of the flex's surface vertices, m; null for dimension 1
    const int* faces;        // [faces, 3] of them
  };
  std::span<const Part> parts() const { return parts_; }

 private:
  struct Flex {
    const FlexSurface* surface;
    double radius;                 // m
    std::vector<double> vertices;  // [V, 3] m, world frame
    std::vector<double> smooth;    // [V, 3] unit normals of the vertices
    std::vector<float> normals;    // [F, 3 corners, 3] unit
    DeformableMesh mesh;           // for dimensions 2 and 3
    std::vector<float> ends;       // [E, 2, 4] m, end positions and radii, for dimension 1
    SceneHandle capsules;
    float box[6];
  };
  void add_sheets(RTCDevice device, Flex& flex);
  void add_capsules(RTCDevice device, Flex& flex);
  static void move_capsules(Flex& flex);
  static void move_sheets(Flex& flex);
  static void shade(Flex& flex);

  std::vector<Flex> flexes_;
  std::vector<void*> scenes_;
  std::vector<Part> parts_;
};

}  // namespace mjsense::rays
