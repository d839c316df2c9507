// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sets boxes and rotations of the shapes of an abstract scene.

#include <algorithm>
#include <span>

#include "mjsense/rays/ray_geom.h"

namespace mjsense::render {

inline void set_box(float x, float y, float z, rays::RayGeom& shape) {
  shape.half[0] = x;
  shape.half[1] = y;
  shape.half[2] = z;
}

// `box`: centre, half sizes.
inline void set_box(std::span<const float, 6> box, rays::RayGeom& shape) {
  std::copy_n(box.data(), 3, shape.center);
  std::copy_n(box.data() + 3, 3, shape.half);
}

inline void set_unrotated(rays::RayGeom& shape) {
  for (int k = 0; k < 9; ++k) shape.mat[k] = shape.rot[k] = k % 4 == 0;
}

}  // namespace mjsense::render
