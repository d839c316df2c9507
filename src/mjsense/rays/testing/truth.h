// SPDX-License-Identifier: Apache-2.0
#pragma once
// MuJoCo's own rays as the truth for ours. They count in double, ours in float32: so a hit is right
// if it is mj_ray's, for the ray itself or for one that float32 can hardly tell from it. No other
// excuse counts: a ray that slips through a seam agrees with none of its neighbours.

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <string>

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

// A ray's neighbourhood: all that are moved along the axes by `move` metres and turned towards them
// by kRoundings radians at most, as float32 does with a ray that it brings into a geom's frame: a
// few roundings of numbers as large as the way to the far side of the farthest geom.
class Neighbours {
 public:
  static constexpr double kRoundings = 4 * 0x1p-24;
  static constexpr double kMiss = 1e30;
  using Offset = std::array<double, 6>;  // -1..1, of the origin and of the direction

  Neighbours(const TestModel& m, const double o[3], const double d[3]) : m_(m) {
    mju_copy3(o_, o);
    mju_copy3(d_, d);
    double reach = 0;
    for (int g = 0; g < m.model->ngeom; ++g)
      reach = std::max(reach, mju_dist3(o, m.data->geom_xpos + 3 * g) + m.model->geom_rbound[g]);
    move_ = kRoundings * reach;
  }

  // How far mj_ray's ray of this offset comes; kMiss if it meets nothing. What it meets up to
  // `behind` metres before its origin counts too, as a negative distance.
  double distance(const Offset& offset, double behind = 0) const {
    double o[3], d[3];
    for (int k = 0; k < 3; ++k) d[k] = d_[k] + kRoundings * offset[3 + k];
    if (offset != Offset{}) mju_normalize3(d);
    for (int k = 0; k < 3; ++k) o[k] = o_[k] + move_ * offset[k] - behind * d[k];
    const double t = mujoco_ray(m_, o, d).t;
    return t < 0 ? kMiss : t - behind;
  }

  // To a corner, or large and small in every direction: on the tip of a roof only a small step aside
  // is left.
  static Offset any(Rng& rng) {
    const bool corner = rng.below(2) != 0;
    Offset offset;
    for (double& x : offset) {
      const double size = corner ? 1.0 : std::exp2(-rng.uniform(0, 16));
      x = rng.below(4) == 0 ? 0.0 : rng.below(2) ? size : -size;
    }
    return offset;
  }

  bool same(double t, const Hit& hit) const {
    if (t == kMiss || !hit) return (t == kMiss) == !hit;
    return std::abs(hit.t - t) <= move_ + kRoundings * t;
  }

  // Whether one between two rays, which come less far and farther than the hit, comes just as far.
  // So it is on a surface that is grazed; at an edge there is none.
  bool same_between(Offset nearer, Offset farther, const Hit& hit, double behind) const {
    for (int i = 0; i < 48; ++i) {
      Offset middle;
      for (int k = 0; k < 6; ++k) middle[k] = 0.5 * (nearer[k] + farther[k]);
      if (same(distance(middle), hit)) return true;
      (distance(middle, behind) < hit.t ? nearer : farther) = middle;
    }
    return false;
  }

 private:
  const TestModel& m_;
  double o_[3], d_[3], move_;
};

// Whether mj_ray says so, of the ray or of one in its neighbourhood.
inline bool agree(const TestModel& m, const double o[3], const double d[3], const Hit& hit) {
  const Neighbours ray(m, o, d);
  if (ray.same(ray.distance({}), hit)) return true;
  // A ray that starts on a surface may have passed it.
  for (const double behind : {0.0, 0.01}) {
    if (behind > 0 && !(hit.t < behind)) break;
    Rng rng(1, 0, 0, 0);
    Neighbours::Offset last[2];  // that came less far than the hit, and farther
    bool known[2] = {false, false};
    int pairs = 300;
    for (int i = 0; i < 20000; ++i) {
      const Neighbours::Offset offset = Neighbours::any(rng);
      if (ray.same(ray.distance(offset), hit)) return true;
      if (!hit || pairs == 0) continue;
      const bool farther = ray.distance(offset, behind) > hit.t;
      last[farther] = offset;
      known[farther] = true;
      if (!known[!farther]) continue;
      if (ray.same_between(last[0], last[1], hit, behind)) return true;
      --pairs;
    }
  }
  return false;
}

// For a person: what both said, and where; "" if they agree.
inline std::string disagreement(const TestModel& m, const double o[3], const double d[3],
                                const Hit& hit) {
  if (agree(m, o, d, hit)) return "";
  const Truth truth = mujoco_ray(m, o, d);
  return "t " + std::to_string(hit.t) + " geom " + std::to_string(hit.geom) + " prim " +
         std::to_string(hit.prim) + ", mj_ray t " + std::to_string(truth.t) + " geom " +
         std::to_string(truth.geom) + ", from " + vec({o[0], o[1], o[2]}) + "along " +
         vec({d[0], d[1], d[2]});
}

// Rays of a test: as many as its author meant, or MJSENSE_TEST_RAYS.
inline long ray_count(long routine) {
  const char* n = std::getenv("MJSENSE_TEST_RAYS");
  return n != nullptr ? std::atol(n) : routine;
}

}  // namespace mjsense::testing
