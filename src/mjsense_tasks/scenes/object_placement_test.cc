// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/object_placement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace mjsense::tasks::scenes {
namespace {

// A disc seen from above.
episode::ObjectShape disc(double radius) {
  episode::ObjectShape shape;
  for (int k = 0; k < 16; ++k) {
    const double angle = k * std::numbers::pi / 8;
    shape.points.push_back({radius * std::cos(angle), radius * std::sin(angle), 0});
  }
  shape.reach = radius;
  return shape;
}

// Places three discs on a strip, all in the target area. Returns the distance between the closest
// two.
double nearest_of_three(double radius, std::uint64_t seed, const LayoutCfg& cfg) {
  const episode::ObjectShape shape = disc(radius);
  const Quat upright{};
  const std::vector<PlacedObject> objects(3, PlacedObject{&shape, {&upright, 1}});
  const std::array<int, 3> wanted{0, 1, 2};
  const std::array<char, 3> present{1, 1, 1};
  // ---(o)----(o)----(o)---  the origins are distributed over the whole strip
  const Area strip{0, 0.6, 0, 0.01};
  const std::array<Region, 1> regions{{{strip, strip, 0.8}}};
  std::array<Pose, 3> poses;
  std::array<int, 3> region_of{};
  Rng rng(seed, 0, 0, 0);
  place_objects(objects, wanted, present, regions, cfg, rng, poses, region_of);
  double minimum = 1;
  for (int a = 0; a < 3; ++a) {
    EXPECT_NEAR(poses[a].p.z, 0.8 + cfg.drop, 1e-12);
    for (int b = 0; b < a; ++b)
      minimum = std::min(minimum, norm(poses[a].p - poses[b].p) - 2 * radius);
  }
  return minimum;
}

TEST(Layout, RestartsIfThereIsNoRoom) {
  int crowded = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    EXPECT_GE(nearest_of_three(0.1, seed, {}), 0) << seed;
    crowded += nearest_of_three(0.1, seed, {.layouts = 1}) < 0;
  }
  EXPECT_GT(crowded, 5);  // some first layouts had overlaps
}

TEST(Layout, TargetsArePlacedInRegionsForTargets) {
  const episode::ObjectShape shape = disc(0.02);
  const Quat upright{};
  const std::vector<PlacedObject> objects(3, PlacedObject{&shape, {&upright, 1}});
  const std::array<int, 1> wanted{1};
  const std::array<char, 3> present{1, 1, 1};
  const Area area{0, 1, 0, 1};
  const std::array<Region, 3> regions{
      {{area, area, 0.5, false}, {area, area, 0.9, true}, {area, area, 1.3, false}}};
  std::array<int, 3> others{};
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    std::array<Pose, 3> poses;
    std::array<int, 3> region_of{};
    Rng rng(seed, 0, 0, 0);
    place_objects(objects, wanted, present, regions, {}, rng, poses, region_of);
    EXPECT_EQ(region_of[1], 1);
    ++others[region_of[0]];
  }
  for (int count : others) EXPECT_GT(count, 0) << "the others stand anywhere";
}

TEST(Layout, UsesTheLayoutWithLeastOverlap) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const double once = nearest_of_three(0.25, seed, {.layouts = 1});
    EXPECT_LT(once, 0);
    EXPECT_GE(nearest_of_three(0.25, seed, {}), once);
  }
}

}  // namespace
}  // namespace mjsense::tasks::scenes
