// SPDX-License-Identifier: Apache-2.0
#pragma once
// A triangle mesh in the form that rays and cameras use. Simulations of the same model in one
// process share it.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "mjsense/rays/embree.h"
#include "mjsense/rays/horizons.h"
#include "mjsense/rays/triangle_clusters.h"

namespace mjsense::rays {

struct DeviceRelease {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneRelease {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using DeviceHandle = std::unique_ptr<RTCDeviceTy, DeviceRelease>;
using SceneHandle = std::unique_ptr<RTCSceneTy, SceneRelease>;

// Embree's device, shared by the whole process and released with the last handle. The environment
// variable MJSENSE_EMBREE adds to its settings (e.g. max_isa=avx2). Throws RuntimeError.
std::shared_ptr<RTCDeviceTy> ray_device();

// Throws RuntimeError if Embree reported an error in this thread since the last check. Embree only
// records errors; without this check rays would hit nothing. `what` names the object that was
// built.
void check_built(RTCDevice device, const std::string& what);

// How a mesh is built. Occlusion does not depend on it; of several hits at the same distance another
// may be found.
enum class BuildQuality : std::uint8_t {
  kHigh,  // for many rays in all directions
  kFast,  // a quarter of the time; later images take up to 1.07 times as long
};

// Builds a scene of one triangle mesh; positions [n, 3] and indices [m, 3] are copied. Throws
// RuntimeError.
SceneHandle build_triangles(RTCDevice device, std::span<const float> vertices,
                            std::span<const int> faces, BuildQuality quality);

struct MeshGeometry {
  std::shared_ptr<RTCDeviceTy> device;
  SceneHandle scene;                   // null if the mesh has no faces
  Clusters clusters;                   // empty unless requested
  std::unique_ptr<Horizons> horizons;  // null unless clusters were requested
  std::array<float, 6> box{};          // bounding box of all vertices: centre, half sizes, m
};

// Returns the geometry of these vertices [n, 3] (m) and faces [m, 3]. `clusters`: also build what
// cameras need.
std::shared_ptr<const MeshGeometry> mesh_geometry(std::span<const float> vertices,
                                                  std::span<const int> faces, bool clusters,
                                                  BuildQuality quality = BuildQuality::kHigh);

}  // namespace mjsense::rays
