// SPDX-License-Identifier: Apache-2.0
#pragma once
// Triangles whose vertices move: a BVH of their own in every world, refitted when they have moved.

#include <span>
#include <vector>

#include "mjsense/rays/shared_geometry.h"

namespace mjsense {

class SoftMesh {
 public:
  SoftMesh() = default;
  // `faces` [F, 3]; `rest` [V, 3]: a shape that suits the BVH, which is built for it once.
  SoftMesh(RTCDevice device, std::span<const int> faces, std::span<const float> rest);

  // A scene of its own for some of the faces.
  void* add_part(RTCDevice device, std::span<const int> faces);

  std::span<float> vertices() { return {vertices_.data(), vertices_.size() - 1}; }  // [V, 3]
  // The vertices have been written. Refits are linear in the number of faces (0.02 ms for 3400) and
  // make one small allocation inside Embree.
  void refit();
  void* scene() const { return scene_.get(); }  // RTCScene; null without faces

 private:
  SceneHandle build(RTCDevice device, std::span<const int> faces);

  std::vector<float> vertices_;  // and one more: Embree loads four coordinates of the last
  SceneHandle scene_;
  std::vector<SceneHandle> parts_;
};

// Embree's scene for one geometry that moves; `geometry` is taken over.
SceneHandle moving_scene(RTCDevice device, RTCGeometry geometry);

// The geometry's vertices have moved.
void refit_scene(RTCScene scene);

// Centre and half sizes of the box around points [N, 3].
void box_around(std::span<const float> points, float box[6]);

}  // namespace mjsense
