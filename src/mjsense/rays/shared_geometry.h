// SPDX-License-Identifier: Apache-2.0
#pragma once
// Shapes shared by all worlds: a BVH per mesh, height fields (which rays march over), the triangles
// of both in clusters (for cameras), and the triangles of flexes.

#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <vector>

#include "mjsense/rays/flex_surface.h"
#include "mjsense/rays/kernels.h"
#include "mjsense/rays/mesh_geometry.h"

namespace mjsense::rays {

// Local bounding boxes (centre, half sizes) of the shared shapes, by mesh id and height field id.
struct ShapeBounds {
  std::vector<std::array<float, 6>> meshes, height_fields;
};

struct SharedGeometry {
  explicit SharedGeometry(const mjModel* model);

  std::shared_ptr<RTCDeviceTy> device;
  std::vector<MeshGeometry> meshes;
  std::vector<void*> mesh_scenes;  // scenes of `meshes`, for the kernels; null without faces
  std::vector<HeightField> height_fields;      // `data` points into the model
  std::vector<std::vector<float>> block_tops;  // of each height field
  // Triangle meshes of the height fields; empty if the model has no cameras, because rays march
  // over the height field itself.
  std::vector<MeshGeometry> surfaces;
  ShapeBounds bounds;
  std::vector<FlexSurface> flexes;  // the parts of flexes that do not depend on the world

  // For images; null if the model has no cameras.
  const Clusters* clusters_of_mesh(int id) const { return meshes[id].clusters.get(); }
  const Clusters* clusters_of_height_field(int id) const {
    return surfaces.empty() ? nullptr : surfaces[id].clusters.get();
  }
  const Horizons* horizons_of_mesh(int id) const { return meshes[id].horizons.get(); }
  const Horizons* horizons_of_height_field(int id) const {
    return surfaces.empty() ? nullptr : surfaces[id].horizons.get();
  }
};

}  // namespace mjsense::rays
