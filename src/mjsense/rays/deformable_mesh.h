// SPDX-License-Identifier: Apache-2.0
#pragma once
// Triangle mesh with moving vertices. Every world has its own BVH, which is refitted when the
// vertices have moved.

#include <span>
#include <vector>

#include "mjsense/rays/shared_geometry.h"

namespace mjsense::rays {

class DeformableMesh {
 public:
  DeformableMesh() = default;
  // `faces` [F, 3]; `rest` [V, 3]: the shape for which the BVH is built, once.
  DeformableMesh(RTCDevice device, std::span<const int> faces, std::span<const float> rest);

  // Adds a separate scene for a subset of the faces and returns its RTCScene.
  void* add_part(RTCDevice device, std::span<const int> faces);

  std::span<float> vertices() { return {vertices_.data(), vertices_.size() - 1}; }  // [V, 3]
  std::span<const float> vertices() const { return {vertices_.data(), vertices_.size() - 1}; }
  // Call after writing vertices(). The cost is linear in the number of faces (0.02 ms for 3400),
  // and Embree makes one small allocation.
  void refit();
  void* scene() const { return scene_.get(); }  // RTCScene; null without faces

 private:
  SceneHandle build(RTCDevice device, std::span<const int> faces);

  std::vector<float> vertices_;  // one extra: Embree loads four floats for the last vertex
  SceneHandle scene_;
  std::vector<SceneHandle> parts_;
};

// Creates an Embree scene for one moving geometry. Takes ownership of `geometry`.
SceneHandle moving_scene(RTCDevice device, RTCGeometry geometry);

// Call after the geometry's vertices have moved.
void refit_scene(RTCScene scene);

}  // namespace mjsense::rays
