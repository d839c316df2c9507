// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/mesh_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <mutex>

#include "mjsense/core/content_cache.h"
#include "mjsense/core/error.h"

namespace mjsense::rays {
namespace {

std::array<float, 6> box_around(std::span<const float> vertices) {
  std::array<float, 6> box{};
  for (int k = 0; k < 3; ++k) {
    float low = std::numeric_limits<float>::infinity(), high = -low;
    for (std::size_t i = k; i < vertices.size(); i += 3) {
      low = std::min(low, vertices[i]);
      high = std::max(high, vertices[i]);
    }
    box[k] = 0.5f * (low + high);
    box[3 + k] = 0.5f * (high - low);
  }
  return box;
}

// Message of Embree's last error in this thread.
std::string& last_error() {
  thread_local std::string text;
  return text;
}

}  // namespace

std::shared_ptr<RTCDeviceTy> ray_device() {
  static std::mutex mutex;
  static std::weak_ptr<RTCDeviceTy> kept;
  const std::lock_guard lock(mutex);
  if (auto device = kept.lock()) return device;
  // With one thread a BVH, and thus every result, is the same on every machine.
  std::string settings = "threads=1";
  if (const char* more = std::getenv("MJSENSE_EMBREE")) settings += fmt::format(",{}", more);
  std::shared_ptr<RTCDeviceTy> device(rtcNewDevice(settings.c_str()), [](RTCDevice d) {
    if (d) rtcReleaseDevice(d);
  });
  if (!device)
    throw RuntimeError(fmt::format("ray scene: Embree could not create a device (error {})",
                                   static_cast<int>(rtcGetDeviceError(nullptr))));
  rtcSetDeviceErrorFunction(
      device.get(), [](void*, RTCError, const char* text) { last_error() = text ? text : ""; },
      nullptr);
  kept = device;
  return device;
}

void check_built(RTCDevice device, const std::string& what) {
  if (const RTCError error = rtcGetDeviceError(device))
    throw RuntimeError(fmt::format("ray scene: Embree could not build {}: {} (error {})", what,
                                   last_error(), static_cast<int>(error)));
}

SceneHandle build_triangles(RTCDevice device, std::span<const float> vertices,
                            std::span<const int> faces, BuildQuality quality) {
  const std::string what =
      fmt::format("a mesh of {} vertices and {} faces", vertices.size() / 3, faces.size() / 3);
  SceneHandle scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), kSceneFlags);
  const RTCBuildQuality built =
      quality == BuildQuality::kHigh ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_LOW;
  rtcSetSceneBuildQuality(scene.get(), built);
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  if (quality == BuildQuality::kFast) rtcSetGeometryBuildQuality(geometry, built);
  void* v = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                    3 * sizeof(float), vertices.size() / 3);
  void* f = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                    3 * sizeof(int), faces.size() / 3);
  if (v == nullptr || f == nullptr) {
    rtcReleaseGeometry(geometry);
    check_built(device, what);
  }
  std::ranges::copy(vertices, static_cast<float*>(v));
  std::ranges::copy(faces, static_cast<int*>(f));
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene.get());
  check_built(device, what);
  return scene;
}

std::shared_ptr<const MeshGeometry> mesh_geometry(std::span<const float> vertices,
                                                  std::span<const int> faces, bool clusters,
                                                  BuildQuality quality) {
  static ContentCache<MeshGeometry> all;
  const ContentKey key = ContentKey()
                             .add(vertices)
                             .add(faces)
                             .add(std::span(&clusters, 1))
                             .add(std::span(&quality, 1));
  return all.get(key, [&] {
    auto made = std::make_shared<MeshGeometry>();
    made->box = box_around(vertices);
    if (faces.empty()) return made;
    made->device = ray_device();
    made->scene = build_triangles(made->device.get(), vertices, faces, quality);
    if (clusters) {
      made->clusters =
          build_clusters(vertices.data(), faces.data(), static_cast<int>(faces.size() / 3));
      made->horizons = std::make_unique<Horizons>(made->clusters);
    }
    return made;
  });
}

}  // namespace mjsense::rays
