// SPDX-License-Identifier: Apache-2.0
// Tests of testing/truth.h: which hits it accepts and which it rejects.

#include "mjsense/rays/testing/reference.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace mjsense::rays {
namespace {

using testing::agree;
using testing::Neighbours;

Hit at(double t, std::array<float, 3> normal = {0, 0, 1}) {
  Hit hit;
  hit.t = t;
  hit.geom = 0;
  hit.normal = normal;
  return hit;
}
const Hit kNothing;

//      | |
//    __v_v      a box 1 m high on a floor
//   |    |
// --+----+---
const TestModel& step() {
  static const TestModel model(
      "<mujoco><worldbody><geom type='plane' size='0 0 1'/>"
      "<geom type='box' size='1 1 .5' pos='0 0 .5'/></worldbody></mujoco>");
  return model;
}

TEST(Reference, HitMustEqualMjRay) {
  const double o[3] = {0.3, 0.2, 4}, down[3] = {0, 0, -1};
  EXPECT_TRUE(agree(step(), o, down, at(3)));
  EXPECT_TRUE(agree(step(), o, down, at(3.0000005)));  // off by one or two roundings
  EXPECT_FALSE(agree(step(), o, down, at(3.00001)));
  EXPECT_FALSE(agree(step(), o, down, at(2.99999)));
  EXPECT_FALSE(agree(step(), o, down, at(4)));
  EXPECT_FALSE(agree(step(), o, down, kNothing));
  const double up[3] = {0, 0, 1};
  EXPECT_TRUE(agree(step(), o, up, kNothing));
  EXPECT_FALSE(agree(step(), o, up, at(3)));
}

// At the edge of a plate mj_ray's distance jumps between two values. Both are accepted where
// rounding decides, but no value between them.
TEST(Reference, AtAnEdgeBothDistancesAreAccepted) {
  const TestModel shelf(
      "<mujoco><worldbody><geom type='plane' size='0 0 1'/>"
      "<geom type='box' size='1 1 .001' pos='0 0 .999'/></worldbody></mujoco>");
  const double down[3] = {0, 0, -1};
  for (double beside : {0.0, 2e-7, -2e-7}) {
    const double o[3] = {1 + beside, 0.2, 4};
    EXPECT_TRUE(agree(shelf, o, down, at(3))) << beside;
    EXPECT_TRUE(agree(shelf, o, down, at(4))) << beside;
    for (double t : {2.9999, 3.01, 3.5, 3.9999}) EXPECT_FALSE(agree(shelf, o, down, at(t))) << t;
    EXPECT_FALSE(agree(shelf, o, down, kNothing));
  }
  for (double beside : {1e-5, -1e-5}) {
    const double o[3] = {1 + beside, 0.2, 4};
    EXPECT_EQ(agree(shelf, o, down, at(3)), beside < 0);
    EXPECT_EQ(agree(shelf, o, down, at(4)), beside > 0);
  }
}

// For a ray nearly parallel to the floor, a turn by one rounding moves the hit by metres.
TEST(Reference, GrazingHitsOfTurnedRaysAreAccepted) {
  const double slope = 1e-5, d[3] = {std::sqrt(1 - slope * slope), 0, -slope};
  const double o[3] = {5, 0, 1e-3};
  const double t = o[2] / slope;  // 100 m
  const double turned = o[2] / (slope + 0.9 * Neighbours::kRoundings);
  ASSERT_GT(t - turned, 1);
  EXPECT_TRUE(agree(step(), o, d, at(t)));
  EXPECT_TRUE(agree(step(), o, d, at(turned)));
  EXPECT_TRUE(agree(step(), o, d, at(0.5 * (t + turned))));
  EXPECT_FALSE(agree(step(), o, d, at(t - 4 * (t - turned))));
  EXPECT_FALSE(agree(step(), o, d, kNothing));
}

// A ray in the plane of a wall may hit its near edge, miss it, or hit it anywhere between.
TEST(Reference, RayInAWallMayHitItAnywhereOrMiss) {
  const double along[3] = {0, 1, 0};
  const double in_it[3] = {1, -3, 0.5}, beside[3] = {1 + 1e-5, -3, 0.5};
  const double within[3] = {1 - 1e-5, -3, 0.5};
  const auto wall = [](double t) { return at(t, {1, 0, 0}); };
  for (double t : {2.0, 2.7, 3.9}) {
    EXPECT_TRUE(agree(step(), in_it, along, wall(t))) << t;
    EXPECT_FALSE(agree(step(), beside, along, wall(t))) << t;
    EXPECT_EQ(agree(step(), within, along, wall(t)), t == 2) << t;
  }
  EXPECT_TRUE(agree(step(), in_it, along, kNothing));
  EXPECT_TRUE(agree(step(), beside, along, kNothing));
  EXPECT_FALSE(agree(step(), within, along, kNothing));
  EXPECT_FALSE(agree(step(), in_it, along, wall(1.9)));
  EXPECT_FALSE(agree(step(), in_it, along, wall(4.1)));
}

// A hit on a surface is rejected if every neighbouring ray is stopped before it.
TEST(Reference, HitBehindASurfaceIsRejected) {
  const double o[3] = {0.3, 0.2, 4}, down[3] = {0, 0, -1};
  EXPECT_FALSE(agree(step(), o, down, at(4)));
  EXPECT_FALSE(agree(step(), o, down, at(4, {0, 0, -1})));
  const double inside[3] = {0.3, 0.2, 0.4};
  EXPECT_TRUE(agree(step(), inside, down, at(0.4)));
  EXPECT_FALSE(agree(step(), inside, down, kNothing));
}

}  // namespace
}  // namespace mjsense::rays
