// SPDX-License-Identifier: Apache-2.0
#pragma once
// Axis-aligned boxes of points, and the corners of boxes.

#include <algorithm>
#include <array>

#include "mjsense/core/pose.h"

namespace mjsense {

// An axis-aligned box, m; empty until a point is added.
struct Aabb {
  Vec3 low{1e10, 1e10, 1e10}, high{-1e10, -1e10, -1e10};

  void add(Vec3 p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  Vec3 center() const { return 0.5 * (low + high); }
  Vec3 size() const { return high - low; }
};

template <class Points>
Aabb aabb_of(const Points& points) {
  Aabb box;
  for (Vec3 p : points) box.add(p);
  return box;
}

// The corners of a box with these half extents. Bits 0, 1 and 2 of the index select the positive
// side of x, y and z.
inline std::array<Vec3, 8> box_corners(Vec3 center, Vec3 half) {
  std::array<Vec3, 8> corners;
  for (int i = 0; i < 8; ++i)
    corners[i] =
        center + Vec3{i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z};
  return corners;
}

}  // namespace mjsense
