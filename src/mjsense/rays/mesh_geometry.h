// SPDX-License-Identifier: Apache-2.0
#pragma once
// A triangle mesh as rays and images meet it, once in a process: simulations of the same robot share
// it.

#include <array>
#include <memory>
#include <span>
#include <string>

#include "mjsense/rays/clusters.h"
#include "mjsense/rays/embree.h"
#include "mjsense/rays/horizons.h"

namespace mjsense {

struct DeviceRelease {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneRelease {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using DeviceHandle = std::unique_ptr<RTCDeviceTy, DeviceRelease>;
using SceneHandle = std::unique_ptr<RTCSceneTy, SceneRelease>;

// That of the process, which ends with the last that holds it. The environment variable MJSENSE_EMBREE adds to
// its settings (max_isa=avx2). Throws RuntimeError.
std::shared_ptr<RTCDeviceTy> ray_device();

// Embree only notes what went wrong, and rays would meet nothing: throws RuntimeError if it did in this thread
// since the last check. `what` was to be built.
void check_built(RTCDevice device, const std::string& what);

// A scene of one triangle mesh; positions [n, 3] and indices [m, 3] are copied. Throws RuntimeError.
SceneHandle build_triangles(RTCDevice device, std::span<const float> vertices,
                            std::span<const int> faces);

struct MeshGeometry {
  std::shared_ptr<RTCDeviceTy> device;
  SceneHandle scene;                   // null without faces
  Clusters clusters;                   // empty unless wanted
  std::unique_ptr<Horizons> horizons;  // null: the same
  std::array<float, 6> box{};          // around all vertices: center, half
};

// Of these vertices [n, 3] (m) and faces [m, 3]; `clusters`: for images, too.
std::shared_ptr<const MeshGeometry> mesh_geometry(std::span<const float> vertices,
                                                  std::span<const int> faces, bool clusters);

}  // namespace mjsense
