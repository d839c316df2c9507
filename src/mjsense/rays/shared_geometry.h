// SPDX-License-Identifier: Apache-2.0
#pragma once
// The shapes that all worlds share: a BVH for each mesh; height fields, which rays march over; for
// cameras the triangles of both in blocks; the triangles of flexes.

#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <vector>

#include "mjsense/rays/flex_surface.h"
#include "mjsense/rays/kernels.h"
#include "mjsense/rays/mesh_geometry.h"

namespace mjsense {

// Local boxes (center, half) of the shared shapes, by mesh and height-field id.
struct ShapeBounds {
  std::vector<std::array<float, 6>> meshes, height_fields;
};

struct SharedGeometry {
  explicit SharedGeometry(const mjModel* model);

  std::shared_ptr<RTCDeviceTy> device;
  std::vector<std::shared_ptr<const MeshGeometry>> meshes;
  std::vector<void*> mesh_scenes;              // theirs, for the kernels; null without faces
  std::vector<HeightField> height_fields;      // data: the model's
  std::vector<std::vector<float>> block_tops;  // of each height field
  // Of height fields, if the model has cameras: rays march.
  std::vector<std::shared_ptr<const MeshGeometry>> surfaces;
  ShapeBounds bounds;
  std::vector<FlexSurface> flexes;  // what does not move of them

  // For images; null if the model has no camera.
  const Clusters* clusters_of_mesh(int id) const { return clusters(meshes, id); }
  const Clusters* clusters_of_height_field(int id) const { return clusters(surfaces, id); }
  const Horizons* horizons_of_mesh(int id) const { return meshes[id]->horizons.get(); }
  const Horizons* horizons_of_height_field(int id) const {
    return clusters_of_height_field(id) ? surfaces[id]->horizons.get() : nullptr;
  }

 private:
  static const Clusters* clusters(const std::vector<std::shared_ptr<const MeshGeometry>>& all,
                                  std::size_t id) {
    return id < all.size() && !all[id]->clusters.nodes.empty() ? &all[id]->clusters : nullptr;
  }
};

}  // namespace mjsense
