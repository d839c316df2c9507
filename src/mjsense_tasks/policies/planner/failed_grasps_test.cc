// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/failed_grasps.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mjsense::tasks::policies {
namespace {

TEST(FailedGrasps, MatchesSimilarGraspsAndSwappedFingers) {
  FailedGrasps failed;
  const Pose grasp{{0.01, 0.02, 0.03}, axis_angle({0, 1, 0}, 0.7)};
  EXPECT_FALSE(failed.has(grasp));
  failed.add(grasp);
  EXPECT_TRUE(failed.has(grasp));
  EXPECT_TRUE(failed.has(grasp * Pose{{0, 0, 0.011}, axis_angle({1, 0, 0}, 0.39)}));
  EXPECT_TRUE(failed.has(grasp * Pose{{}, axis_angle({0, 0, 1}, M_PI)})) << "fingers swapped";
  EXPECT_FALSE(failed.has(grasp * Pose{{0, 0, 0.013}, {}}));
  EXPECT_FALSE(failed.has(grasp * Pose{{}, axis_angle({0, 0, 1}, 0.5 * M_PI)}));
  failed.clear();
  EXPECT_FALSE(failed.has(grasp));
}

}  // namespace
}  // namespace mjsense::tasks::policies
