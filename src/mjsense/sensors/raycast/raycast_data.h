// SPDX-License-Identifier: Apache-2.0
#pragma once
// Declares the fields of ray sensors, lidars and terrain height sensors.

#include "mjsense/core/fields/data_class.h"

namespace mjsense::sensors {

// clang-format off
inline constexpr DataField kRayCastDataFields[] = {
  {"distances", DType::kFloat32, "B, R", "m", "Along each ray to the nearest surface; -1: nothing within max_distance."},
  {"hit_pos_w", DType::kFloat32, "B, R, 3", "m", "Where each ray hits, world; its origin on a miss."},
  {"normals_w", DType::kFloat32, "B, R, 3", "", "Unit normal of the surface hit, world: outward, or by the triangle's winding; 0 on a miss."},
  {"frame_pos_w", DType::kFloat32, "B, F, 3", "m", "Position of each frame, world."},
  {"frame_quat_w", DType::kFloat32, "B, F, 4", "", "Orientation (wxyz) of each frame, world: the frame's own, not the aligned one; the largest component is positive."},
  {"pos_w", DType::kFloat32, "B, 3", "m", "Position of frame 0, world."},
  {"quat_w", DType::kFloat32, "B, 4", "", "Orientation (wxyz) of frame 0, world."},
  {"geom_id", DType::kInt32, "B, R", "", "Geom that each ray hits; -1: none; number of geoms + flex id: a flex."},
  {"body_id", DType::kInt32, "B, R", "", "Body of the geom that each ray hits; -1: none, or a flex."},
  {"material_id", DType::kInt32, "B, R", "", "Material of the geom that each ray hits; -1: none."},
  {"heights", DType::kFloat32, "B, F", "m", "Terrain height sensors: of each frame above the surface below it; [B, F, n] without reduction."},
  {"points", DType::kFloat32, "B, R, 3", "m", "Lidars: what the device reports, sensor frame; 0 without a return."},
  {"intensity", DType::kFloat32, "B, R", "", "Lidars: the surface's albedo times the cosine of incidence, 0 to 1; 0 without a return."},
};
// clang-format on

inline constexpr DataClass kRayCastData{
    "RayCastData", "Hits of ``R = F * n`` rays, frame by frame.", kRayCastDataFields};

}  // namespace mjsense::sensors
