#include "mjsense/rays/ray_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>

#include "mjsense/rays/test_scene.h"

namespace mjsense {
namespace {

using testing::TestModel;

struct Truth {
  double t = -1;
  int geom = -1;
  double normal[3] = {0, 0, 0};
};

Truth mujoco_ray(const TestModel& m, const double o[3], const double d[3],
                 const mjtByte* groups = nullptr, int exclude = -1) {
  Truth r;
  r.t = mj_ray(m.model, m.data, o, d, groups, 1, exclude, &r.geom, r.normal);
  return r;
}

// Same surface at the same place; where they differ, the ray must graze: moved by 5 micrometres,
// mj_ray itself changes its mind.
bool agree(const TestModel& m, const double o[3], const double d[3], const Hit& hit) {
  const auto same = [&](const Truth& r) {
    if (r.t < 0 || !hit) return (r.t < 0) == !hit;
    // A plane met at a grazing angle a kilometre away is where directions in float32 show.
    return std::abs(hit.t - r.t) <= (r.t > 100 ? 1e-3 * r.t : 1e-5 * std::max(1.0, 0.1 * r.t));
  };
  if (same(mujoco_ray(m, o, d))) return true;
  double lowest = 1e300, highest = -1e300;
  for (int i = 0; i < 27; ++i) {
    for (double e : {2e-6, 5e-6, 1e-5}) {
      const double moved[3] = {o[0] + e * (i % 3 - 1), o[1] + e * (i / 3 % 3 - 1),
                               o[2] + e * (i / 9 - 1)};
      const Truth r = mujoco_ray(m, moved, d);
      if (same(r)) return true;
      lowest = std::min(lowest, r.t < 0 ? 1e10 : r.t);
      highest = std::max(highest, r.t < 0 ? 1e10 : r.t);
    }
  }
  const double t = !hit ? 1e10 : hit.t;
  return lowest <= t && t <= highest;
}

long ray_count(long routine) {
  const char* n = std::getenv("MJSENSE_TEST_RAYS");
  return n != nullptr ? std::atol(n) : routine;
}

class RandomRays : public ::testing::TestWithParam<const char*> {};

TEST_P(RandomRays, AgreeWithMjRay) {
  Rng rng(7, 0, stream_of(GetParam()), 0);
  const long total = ray_count(20000);
  const int scenes = 5;
  long wrong = 0, wrong_geom = 0, wrong_normal = 0, hits = 0;
  for (int s = 0; s < scenes; ++s) {
    const std::string type = GetParam();
    const std::string xml = type == "all"
                                ? testing::random_scene(rng,
                                                        {"plane", "sphere", "capsule", "ellipsoid",
                                                         "cylinder", "box", "mesh", "hfield"},
                                                        40, 4)
                                : testing::random_scene(rng, {GetParam()}, 6, 1.5);
    const TestModel m(xml);
    RayScene scene(m.model, 1);
    scene.update(m.world());
    for (long i = 0; i < total / scenes; ++i) {
      double o[3], d[3];
      for (double& x : o) x = rng.uniform(-5, 5);
      testing::random_direction(rng, d);
      if (rng.below(2)) testing::aim(rng, 1.5, o, d);
      if (rng.below(4) == 0) {  // straight along an axis
        const int axis = rng.below(3);
        for (int k = 0; k < 3; ++k) d[k] = k == axis ? (d[k] < 0 ? -1 : 1) : 0;
      }
      const Truth truth = mujoco_ray(m, o, d);
      const Hit hit = scene.trace(0, {}, o, d);
      hits += truth.t >= 0;
      if (!agree(m, o, d, hit)) {
        if (++wrong <= 5)
          ADD_FAILURE() << "origin " << o[0] << " " << o[1] << " " << o[2] << " direction " << d[0]
                        << " " << d[1] << " " << d[2] << ": t " << hit.t << " geom " << hit.geom
                        << ", mj_ray " << truth.t << " geom " << truth.geom;
        continue;
      }
      if (truth.t < 0 || !hit || std::abs(hit.t - truth.t) > 1e-5) continue;
      wrong_geom += hit.geom != truth.geom;
      double cosine = 0;
      for (int k = 0; k < 3; ++k) cosine += truth.normal[k] * hit.normal[k];
      wrong_normal += hit.geom == truth.geom && cosine < 0.999;
    }
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(hits, total / 50) << "too few hits to mean anything";
  EXPECT_LE(wrong_geom, total / 10000);
  EXPECT_LE(wrong_normal, total / 5000);  // rays that hit an edge
}

INSTANTIATE_TEST_SUITE_P(Shapes, RandomRays,
                         ::testing::Values("plane", "sphere", "capsule", "ellipsoid", "cylinder",
                                           "box", "mesh", "hfield", "all"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace mjsense
