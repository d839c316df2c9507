// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/mesh_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <mutex>

#include "mjsense/core/error.h"

namespace mjsense::rays {
namespace {

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

void box_around(std::span<const float> points, float box[6]) {
  constexpr float inf = std::numeric_limits<float>::infinity();
  std::array<float, 3> low = {inf, inf, inf}, high = {-inf, -inf, -inf};
  std::size_t i = 0;
  // Four points at once: three vectors, whose lanes have the coordinates x y z x, y z x y, z x y z.
  using Four [[gnu::vector_size(16)]] = float;
  Four least[3], most[3];
  std::fill_n(least, 3, Four{inf, inf, inf, inf});
  std::fill_n(most, 3, Four{-inf, -inf, -inf, -inf});
  for (; i + 12 <= points.size(); i += 12)
    for (std::size_t j = 0; j < 3; ++j) {
      Four x;
      std::memcpy(&x, points.data() + i + 4 * j, sizeof x);
      least[j] = x < least[j] ? x : least[j];
      most[j] = most[j] < x ? x : most[j];
    }
  for (int j = 0; j < 12; ++j) {
    low[j % 3] = std::min(low[j % 3], least[j / 4][j % 4]);
    high[j % 3] = std::max(high[j % 3], most[j / 4][j % 4]);
  }
  for (; i < points.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], points[i]);
    high[i % 3] = std::max(high[i % 3], points[i]);
  }
  for (int k = 0; k < 3; ++k) {
    box[k] = 0.5f * (low[k] + high[k]);
    box[3 + k] = 0.5f * (high[k] - low[k]);
  }
}

std::shared_ptr<const MeshScene> mesh_scene(const MeshArrays& mesh, BuildQuality quality) {
  static ContentCache<MeshScene> all;
  return all.get(ContentKey(mesh.key).add(std::span(&quality, 1)), [&] {
    auto made = std::make_shared<MeshScene>();
    made->device = ray_device();
    made->scene = build_triangles(made->device.get(), mesh.vertices, mesh.faces, quality);
    return made;
  });
}

std::shared_ptr<const Clusters> mesh_clusters(const MeshArrays& mesh) {
  static ContentCache<Clusters> all;
  return all.get(mesh.key, [&] {
    return std::make_shared<Clusters>(build_clusters(mesh.vertices.data(), mesh.faces.data(),
                                                     static_cast<int>(mesh.faces.size() / 3)));
  });
}

std::shared_ptr<const Horizons> mesh_horizons(const MeshArrays& mesh) {
  static ContentCache<Horizons> all;
  return all.get(mesh.key, [&] { return std::make_shared<Horizons>(*mesh_clusters(mesh)); });
}

MeshGeometry::MeshGeometry(const MeshArrays& mesh, bool images) {
  box_around(mesh.vertices, box.data());
  if (mesh.faces.empty()) return;
  scene = mesh_scene(mesh, BuildQuality::kHigh);
  if (!images) return;
  clusters = mesh_clusters(mesh);
  horizons = mesh_horizons(mesh);
}

}  // namespace mjsense::rays
