// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reference results from mj_ray. It computes in double, the kernels in float32. A result is
// therefore accepted if mj_ray returns it for the ray itself or for a ray within float32 rounding
// of it. A ray that slips through a seam travels farther than all of these, so the test detects it.

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "mjsense/rays/packet.h"
#include "mjsense/rays/testing/scene.h"

namespace mjsense::testing {

struct Reference {
  double t = -1;
  int geom = -1;
  double normal[3] = {0, 0, 0};
};

inline Reference mujoco_ray(const TestModel& m, const double o[3], const double d[3],
                            const mjtByte* groups = nullptr, int exclude = -1) {
  Reference r;
  r.t = mj_ray(m.model, m.data, o, d, groups, 1, exclude, &r.geom, r.normal);
  return r;
}

// A ray and its neighbours: all rays whose origin is moved along the axes by at most `move_` metres
// and whose direction is turned by at most kRoundings radians. These are the errors that float32
// makes when it transforms a ray into a geom's frame: a few roundings of numbers as large as the
// distance to the far side of the farthest geom.
class Neighbours {
 public:
  static constexpr double kRoundings = 4 * 0x1p-24;
  static constexpr double kMiss = 1e30;

  Neighbours(const TestModel& m, const double o[3], const double d[3]) : m_(m) {
    mju_copy3(o_, o);
    mju_copy3(d_, d);
    double reach = 0;
    for (int g = 0; g < m.model->ngeom; ++g)
      reach = std::max(reach, mju_dist3(o, m.data->geom_xpos + 3 * g) + m.model->geom_rbound[g]);
    move_ = kRoundings * reach;
  }

  // The distance of mj_ray's hit; kMiss if there is none.
  double distance() const { return distance(o_, d_); }
  // The same for a random neighbour.
  double distance(Rng& rng) const {
    double by[6], o[3], d[3];
    any(rng, by);
    for (int k = 0; k < 3; ++k) {
      o[k] = o_[k] + move_ * by[k];
      d[k] = d_[k] + kRoundings * by[3 + k];
    }
    mju_normalize3(d);
    return distance(o, d);
  }

  // Tolerance of a hit at t metres.
  double rounding(double t) const { return move_ + kRoundings * t; }
  bool same(double t, const rays::Hit& hit) const {
    if (t == kMiss || !hit) return (t == kMiss) == !hit;
    return std::abs(hit.t - t) <= rounding(t);
  }

  // Whether the ray's point at the hit lies on a surface. Rays are cast down at it from random
  // points nearby.
  bool on_surface(const rays::Hit& hit, Rng& rng) const {
    constexpr double kAbove = 1e-4;
    double up[3], from[3], by[6];
    for (int k = 0; k < 3; ++k) up[k] = hit.normal[k];
    if (mju_normalize3(up) < 0.5) return false;
    const double down[3] = {-up[0], -up[1], -up[2]};
    for (int i = 0; i < 300; ++i) {
      any(rng, by);
      const double sideways = mju_dot3(by, up);
      for (int k = 0; k < 3; ++k)
        from[k] =
            o_[k] + hit.t * d_[k] + kAbove * up[k] + rounding(hit.t) * (by[k] - sideways * up[k]);
      if (std::abs(distance(from, down) - kAbove) <= rounding(hit.t)) return true;
    }
    return false;
  }

 private:
  double distance(const double o[3], const double d[3]) const {
    const double t = mujoco_ray(m_, o, d).t;
    return t < 0 ? kMiss : t;
  }

  // Numbers from -1 to 1: either the corner of a cube, or a mixture of large and small ones, since
  // at the tip of a roof only small offsets still hit it.
  static void any(Rng& rng, double by[6]) {
    const bool corner = rng.below(2) != 0;
    for (int k = 0; k < 6; ++k) {
      const double size = corner ? 1.0 : std::exp2(-rng.uniform(0, 16));
      by[k] = rng.below(4) == 0 ? 0.0 : rng.below(2) ? size : -size;
    }
  }

  const TestModel& m_;
  double o_[3], d_[3], move_;
};

// Whether mj_ray returns the same hit for the ray or for one of its neighbours. A ray that grazes a
// surface may meet it anywhere along a long stretch, because of roundings that differ from point to
// point. For such a ray it is sufficient that some neighbour travels farther than the hit, and that
// the ray's point at the hit lies on a surface.
inline bool agree(const TestModel& m, const double o[3], const double d[3], const rays::Hit& hit) {
  const Neighbours ray(m, o, d);
  if (ray.same(ray.distance(), hit)) return true;
  Rng rng(1, 0, 0, 0);
  const bool on_surface = !!hit && ray.on_surface(hit, rng);
  for (int i = 0; i < 20000; ++i) {
    const double t = ray.distance(rng);
    if (ray.same(t, hit) || (on_surface && t > hit.t)) return true;
  }
  return false;
}

// Message for a failed test: both results, and the ray. "" if they agree.
inline std::string disagreement(const TestModel& m, const double o[3], const double d[3],
                                const rays::Hit& hit) {
  if (agree(m, o, d, hit)) return "";
  const Reference reference = mujoco_ray(m, o, d);
  return "t " + std::to_string(hit.t) + " geom " + std::to_string(hit.geom) + " prim " +
         std::to_string(hit.prim) + ", mj_ray t " + std::to_string(reference.t) + " geom " +
         std::to_string(reference.geom) + ", from " + vec({o[0], o[1], o[2]}) + "along " +
         vec({d[0], d[1], d[2]});
}

// Number of rays in a test: `routine`, or the environment variable MJSENSE_TEST_RAYS.
inline long ray_count(long routine) {
  const char* n = std::getenv("MJSENSE_TEST_RAYS");
  return n != nullptr ? std::atol(n) : routine;
}

}  // namespace mjsense::testing
