// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/deformable_mesh.h"

#include <algorithm>

#include "mjsense/rays/mesh_geometry.h"

namespace mjsense::rays {

SceneHandle moving_scene(RTCDevice device, RTCGeometry geometry) {
  SceneHandle scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), static_cast<RTCSceneFlags>(kSceneFlags | RTC_SCENE_FLAG_DYNAMIC));
  // Embree refits only at this quality. At any other it rebuilds the BVH, which takes 20 to 40
  // times as long.
  rtcSetSceneBuildQuality(scene.get(), RTC_BUILD_QUALITY_LOW);
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene.get(), geometry, 0);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene.get());
  check_built(device, "a flex or skin");
  return scene;
}

void refit_scene(RTCScene scene) {
  RTCGeometry geometry = rtcGetGeometry(scene, 0);
  rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
  rtcCommitGeometry(geometry);
  rtcCommitScene(scene);
}

DeformableMesh::DeformableMesh(RTCDevice device, std::span<const int> faces,
                               std::span<const float> rest)
    : vertices_(rest.begin(), rest.end()) {
  vertices_.push_back(0);
  scene_ = build(device, faces);
}

SceneHandle DeformableMesh::build(RTCDevice device, std::span<const int> faces) {
  if (faces.empty()) return nullptr;
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_REFIT);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                             vertices_.data(), 0, 3 * sizeof(float), vertices_.size() / 3);
  void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                          3 * sizeof(int), faces.size() / 3);
  std::copy(faces.begin(), faces.end(), static_cast<int*>(indices));
  return moving_scene(device, geometry);
}

void* DeformableMesh::add_part(RTCDevice device, std::span<const int> faces) {
  return parts_.emplace_back(build(device, faces)).get();
}

void DeformableMesh::refit() {
  if (scene_) refit_scene(scene_.get());
  for (const SceneHandle& part : parts_)
    if (part) refit_scene(part.get());
}

}  // namespace mjsense::rays
