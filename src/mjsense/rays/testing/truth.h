// SPDX-License-Identifier: Apache-2.0
#pragma once
// MuJoCo's own rays as the truth for ours.

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "mjsense/rays/packet.h"
#include "mjsense/rays/testing/scene.h"

namespace mjsense::testing {

struct Truth {
  double t = -1;
  int geom = -1;
  double normal[3] = {0, 0, 0};
};

inline Truth mujoco_ray(const TestModel& m, const double o[3], const double d[3],
                        const mjtByte* groups = nullptr, int exclude = -1) {
  Truth r;
  r.t = mj_ray(m.model, m.data, o, d, groups, 1, exclude, &r.geom, r.normal);
  return r;
}

// The i-th of 27 steps of `length` to the neighbours of a point, and none.
inline void nudge(int i, double length, const double from[3], double to[3]) {
  for (int k = 0; k < 3; ++k, i /= 3) to[k] = from[k] + length * (i % 3 - 1);
}

// Whether the point that a ray hit lies on a surface, to 2 micrometres along its normal.
inline bool on_surface(const TestModel& m, const double o[3], const double d[3], const Hit& hit) {
  constexpr double kClear = 1e-4;
  double above[3], from[3], down[3];
  for (int k = 0; k < 3; ++k) down[k] = -static_cast<double>(hit.normal[k]);
  mju_normalize3(down);
  for (int k = 0; k < 3; ++k) above[k] = o[k] + hit.t * d[k] - kClear * down[k];
  for (int i = 0; i < 27; ++i) {  // a point of the very border
    nudge(i, 1e-7, above, from);
    if (std::abs(mujoco_ray(m, from, down).t - kClear) < 2e-6) return true;
  }
  return false;
}

// Same surface at the same place; where they differ, the ray must graze, start on a surface, or
// slide along a wall: moved by some micrometres, sideways or back along itself, or turned by a
// microradian, mj_ray itself changes its mind.
inline bool agree(const TestModel& m, const double o[3], const double d[3], const Hit& hit) {
  const auto same = [&](const Truth& r) {
    if (r.t < 0 || !hit) return (r.t < 0) == !hit;
    // A plane met at a grazing angle a kilometre away is where directions in float32 show.
    return std::abs(hit.t - r.t) <= (r.t > 100 ? 1e-3 * r.t : 1e-5 * std::max(1.0, 0.1 * r.t));
  };
  const Truth straight = mujoco_ray(m, o, d);
  if (same(straight)) return true;
  const bool nearer = !!hit && (straight.t < 0 || hit.t < straight.t);
  if (nearer && on_surface(m, o, d, hit)) return true;
  double lowest = 1e300, highest = -1e300;
  const auto same_from = [&](const double from[3], const double along[3], double back) {
    double moved[3];
    for (int k = 0; k < 3; ++k) moved[k] = from[k] - back * along[k];
    Truth r = mujoco_ray(m, moved, along);
    if (r.t >= 0) r.t = std::max(0.0, r.t - back);
    lowest = std::min(lowest, r.t < 0 ? 1e10 : r.t);
    highest = std::max(highest, r.t < 0 ? 1e10 : r.t);
    return same(r);
  };
  double from[3], along[3];
  for (int i = 0; i < 27; ++i) {
    for (double e : {2e-9, 2e-7, 2e-6, 1e-5}) {
      nudge(i, e, o, from);
      if (same_from(from, d, 0) || same_from(from, d, 1.5e-5)) return true;
    }
  }
  const double t = !hit ? 1e10 : hit.t;
  if (lowest - 1e-5 <= t && t <= highest + 1e-5) return true;
  for (int i = 0; i < 27 * 27; ++i) {
    nudge(i / 27, 2e-6, o, from);
    nudge(i % 27, 1e-6, d, along);
    mju_normalize3(along);
    if (same_from(from, along, 0)) return true;
  }
  return false;
}

// Rays of a test: as many as its author meant, or MJSENSE_TEST_RAYS.
inline long ray_count(long routine) {
  const char* n = std::getenv("MJSENSE_TEST_RAYS");
  return n != nullptr ? std::atol(n) : routine;
}

}  // namespace mjsense::testing
