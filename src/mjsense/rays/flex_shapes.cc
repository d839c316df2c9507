#include "mjsense/rays/flex_shapes.h"

#include <algorithm>

namespace mjsense {

FlexShapes::FlexShapes(RTCDevice device, const mjModel* m, std::span<const float> vertices) {
  for (int f = 0; f < m->nflex; ++f) {
    // Cloth shows its elements, a solid its shell: three vertices of this flex a triangle.
    const bool cloth = m->flex_dim[f] == 2;
    const int* faces =
        cloth ? m->flex_elem + m->flex_elemdataadr[f] : m->flex_shell + m->flex_shelldataadr[f];
    const int count = cloth ? m->flex_elemnum[f] : m->flex_dim[f] == 3 ? m->flex_shellnum[f] : 0;
    if (count == 0) {
      scenes_.emplace_back();
      pointers_.push_back(nullptr);
      continue;
    }
    SceneHandle scene(rtcNewScene(device));
    rtcSetSceneFlags(scene.get(), static_cast<RTCSceneFlags>(kSceneFlags | RTC_SCENE_FLAG_DYNAMIC));
    rtcSetSceneBuildQuality(scene.get(), RTC_BUILD_QUALITY_REFIT);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_REFIT);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                               vertices.data(), 3 * sizeof(float) * m->flex_vertadr[f],
                               3 * sizeof(float), m->flex_vertnum[f]);
    void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            3 * sizeof(int), count);
    std::copy_n(faces, 3 * count, static_cast<int*>(indices));
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene.get(), geometry, 0);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene.get());
    pointers_.push_back(scene.get());
    scenes_.push_back(std::move(scene));
  }
}

void FlexShapes::update() {
  for (const SceneHandle& scene : scenes_) {
    if (!scene) continue;
    RTCGeometry geometry = rtcGetGeometry(scene.get(), 0);
    rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(geometry);
    rtcCommitScene(scene.get());
  }
}

}  // namespace mjsense
