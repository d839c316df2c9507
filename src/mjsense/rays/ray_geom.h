// SPDX-License-Identifier: Apache-2.0
#pragma once
// A geom as the kernels see it.

namespace mjsense {

// One geom (or flex) with its shape; X_WG in double, so that a query's origin is brought into its
// frame without loss.
struct alignas(64) RayGeom {
  double pos[3];    // m
  double mat[9];    // row-major R_WG
  float rot[9];     // the same, for directions
  float size[3];    // m, as mjModel's geom_size
  float center[3];  // m, local bounding box
  float half[3];
  int type;  // mjtGeom; kFlexType for a flex, kSkinType for a skin
  int data;  // id of the mesh, height field, flex or skin; or -1
};
inline constexpr int kFlexType = 1000;
inline constexpr int kSkinType = 1001;  // for cameras only

}  // namespace mjsense
