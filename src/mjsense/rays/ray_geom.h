// SPDX-License-Identifier: Apache-2.0
#pragma once
// A geom in the form that the kernels use.

namespace mjsense::rays {

// One geom (or flex) and its shape. X_WG is in double, so that a query's origin is transformed into
// the geom's frame without loss of precision.
struct alignas(64) RayGeom {
  double pos[3];    // m, world frame
  double mat[9];    // row-major R_WG
  float rot[9];     // `mat` in single precision, for directions
  float size[3];    // m, as mjModel's geom_size
  float center[3];  // m, centre of the local bounding box
  float half[3];
  int type;  // mjtGeom, kFlexType or kSkinType
  int data;  // id of the mesh, height field, flex or skin, or -1
};
inline constexpr int kFlexType = 1000;
inline constexpr int kSkinType = 1001;  // hit by cameras only

}  // namespace mjsense::rays
