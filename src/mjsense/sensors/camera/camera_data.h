// SPDX-License-Identifier: Apache-2.0
#pragma once
// Declares the fields of a camera.

#include "mjsense/core/fields/data_class.h"

namespace mjsense::sensors {

// clang-format off
inline constexpr DataField kCameraDataFields[] = {
  {"rgb", DType::kUint8, "B, H, W, 3", "", "Colour image, row 0 at the top."},
  {"hdr", DType::kFloat32, "B, H, W, 3", "cd/m^2", "Linear radiance, before white balance, exposure and tone mapping; only with shading \"pbr\"."},
  {"depth", DType::kFloat32, "B, H, W, 1", "m", "Distance to the camera plane; 0 where nothing is seen."},
  {"segmentation", DType::kInt32, "B, H, W, 2", "", "(id, mjtObj) of each pixel: geom, flex, skin, site or tendon; (-1, -1) where nothing is seen."},
  {"body_segmentation", DType::kInt32, "B, H, W, 1", "", "Body id of each pixel's geom or site; -1 where there is none."},
  {"entity_segmentation", DType::kInt32, "B, H, W, 1", "", "Entity of each pixel, by its place in the scene; -1 where there is none."},
  {"normals", DType::kFloat32, "B, H, W, 3", "", "Unit surface normal in the camera frame; 0 where nothing is seen."},
  {"point_cloud", DType::kFloat32, "B, H, W, 3", "m", "Point in the camera frame (x right, y up, looking along -z); NaN where nothing is seen."},
  {"flow", DType::kFloat32, "B, H, W, 2", "pixels", "Previous image point of the visible surface point minus its current one (u right, v down); NaN where no rigid surface is visible."},
  {"intrinsics", DType::kFloat32, "B, 3, 3", "pixels", "K: image point (u right, v down) of a direction (x right, y down, z forward)."},
  {"pose", DType::kFloat32, "B, 4, 4", "m", "X_WC of the image; the camera looks along its -z axis, y is up in the image."},
};
// clang-format on

inline constexpr DataClass kCameraData{
    "CameraData",
    "Images; row 0 is the top. With depth_kind \"ray\" depth is along each pixel's ray.",
    kCameraDataFields};

}  // namespace mjsense::sensors
