// SPDX-License-Identifier: Apache-2.0
#pragma once
// Faces of a cube map (+x -x +y -y +z -z) and the positions on them, as OpenGL reads cube maps.

#include <cmath>

#include "mjsense/render/light/microfacets.h"

namespace mjsense::render {

struct CubePlace {
  int face;
  double s, t;  // -1..1
};

inline CubePlace cube_place(const Vec3& d) {
  const double x = std::abs(d[0]), y = std::abs(d[1]), z = std::abs(d[2]);
  if (x >= y && x >= z) return {d[0] < 0 ? 1 : 0, (d[0] < 0 ? d[2] : -d[2]) / x, -d[1] / x};
  if (y >= z) return {d[1] < 0 ? 3 : 2, d[0] / y, (d[1] < 0 ? -d[2] : d[2]) / y};
  return {d[2] < 0 ? 5 : 4, (d[2] < 0 ? -d[0] : d[0]) / z, -d[1] / z};
}

// The unit vector to a position. Those on a common edge of two faces have exactly the same.
inline Vec3 cube_direction(const CubePlace& at) {
  const auto [face, s, t] = at;
  switch (face) {
    case 0:
      return unit({1, -t, -s});
    case 1:
      return unit({-1, -t, s});
    case 2:
      return unit({s, 1, t});
    case 3:
      return unit({s, -1, -t});
    case 4:
      return unit({s, -t, 1});
    default:
      return unit({-s, -t, -1});
  }
}

}  // namespace mjsense::render
