// SPDX-License-Identifier: Apache-2.0
#pragma once
// Vectors of the world in the axes of a camera.

namespace mjsense::render {

// out = R^T v, for example of R_WC (row-major).
inline void rotate_back(const double r[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) out[i] = r[i] * v[0] + r[3 + i] * v[1] + r[6 + i] * v[2];
}

}  // namespace mjsense::render
