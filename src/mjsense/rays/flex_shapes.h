// SPDX-License-Identifier: Apache-2.0
#pragma once
// The flexes of one world: their surfaces (flex_surface.h) where the world's vertices are now, in
// the frame of the flex's first vertex (world axes), so that single precision is enough anywhere.

#include <mujoco/mujoco.h>

#include <span>
#include <vector>

#include "mjsense/rays/flex_surface.h"
#include "mjsense/rays/soft_mesh.h"

namespace mjsense {

class FlexShapes {
 public:
  // `surfaces` by flex id; they must outlive this.
  FlexShapes(RTCDevice device, std::span<const FlexSurface> surfaces, const mjModel* model);

  // Takes the world's vertices and radii. A flex that did not move costs a comparison.
  void update(const mjModel* model, const mjData* data);

  std::span<const double> vertices(int flex) const { return flexes_[flex].vertices; }  // m, world
  const double* position(int flex) const { return flexes_[flex].vertices.data(); }     // m, world
  // [6] centre and half sizes of its box, m.
  const float* box(int flex) const { return flexes_[flex].box; }
  // RTCScene by flex id, for rays; null where there is nothing to meet.
  void* const* scenes() const { return scenes_.data(); }

  // What cameras draw, in the order of flex_parts().
  struct Part {
    int flex, element;     // `element`: whose material it has
    int material;          // id or -1
    void* scene;           // RTCScene; null: nothing
    const float* normals;  // [faces, 3 corners, 3] unit; null for lines, and without cameras
  };
  std::span<const Part> parts() const { return parts_; }

 private:
  struct Flex {
    const FlexSurface* surface;
    double radius;                 // m
    std::vector<double> vertices;  // [V, 3] m, world
    std::vector<double> smooth;    // [V, 3] unit normals of the vertices
    std::vector<float> normals;    // [F, 3, 3]
    SoftMesh mesh;                 // dimensions 2 and 3
    std::vector<float> ends;       // [E, 2, 4] m, positions and radii: dimension 1
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

}  // namespace mjsense
