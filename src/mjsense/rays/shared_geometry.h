// SPDX-License-Identifier: Apache-2.0
#pragma once
// The shapes that all worlds share: a BVH for each mesh; height fields, which rays march over; for
// cameras the triangles of both in blocks; the triangles of flexes.

#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <vector>

#include "mjsense/rays/clusters.h"
#include "mjsense/rays/embree.h"
#include "mjsense/rays/flex_surface.h"
#include "mjsense/rays/kernels.h"

namespace mjsense {

struct DeviceRelease {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneRelease {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using DeviceHandle = std::unique_ptr<RTCDeviceTy, DeviceRelease>;
using SceneHandle = std::unique_ptr<RTCSceneTy, SceneRelease>;

// Local boxes (center, half) of the shared shapes, by mesh and height-field id.
struct ShapeBounds {
  std::vector<std::array<float, 6>> meshes, height_fields;
};

struct SharedGeometry {
  explicit SharedGeometry(const mjModel* model);

  DeviceHandle device;
  std::vector<SceneHandle> meshes;             // null for a mesh without faces
  std::vector<void*> mesh_scenes;              // the same, for the kernels
  std::vector<HeightField> height_fields;      // data: the model's
  std::vector<std::vector<float>> block_tops;  // of each height field
  std::vector<SceneHandle> surfaces;  // of height fields, if the model has cameras: rays march
  // For images; none if the model has no camera.
  std::vector<Clusters> mesh_clusters, surface_clusters;
  ShapeBounds bounds;
  std::vector<FlexSurface> flexes;  // what does not move of them

  const Clusters* clusters_of_mesh(int id) const { return clusters(mesh_clusters, id); }
  const Clusters* clusters_of_height_field(int id) const { return clusters(surface_clusters, id); }

 private:
  static const Clusters* clusters(const std::vector<Clusters>& all, std::size_t id) {
    return id < all.size() && !all[id].nodes.empty() ? &all[id] : nullptr;
  }
};

// A scene of one triangle mesh; positions and indices are copied.
SceneHandle build_triangles(RTCDevice device, const float* vertices, int num_vertices,
                            const int* faces, int num_faces);

}  // namespace mjsense
