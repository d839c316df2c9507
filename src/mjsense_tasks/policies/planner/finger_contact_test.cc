// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/finger_contact.h"

#include <gtest/gtest.h>

#include <numbers>
#include <vector>

namespace mjsense::tasks::policies {
namespace {

constexpr double kRadius = 0.016, kHalfWidth = 0.008, kHalfLength = 0.009;  // m

// A round bar along x with points 1 mm apart.
std::vector<Vec3> bar() {
  std::vector<Vec3> points;
  for (int k = 0; k < 100; ++k) {
    const double a = 2 * std::numbers::pi * k / 100;
    for (int i = -20; i <= 20; ++i)
      points.push_back({0.001 * i, kRadius * std::cos(a), kRadius * std::sin(a)});
  }
  return points;
}

// Grasp from above; z: height of the pads' middle above the bar's axis.
FingerContact at_height(double z) {
  return measure_finger_contact(bar(), {0, 0, z}, {0, 1, 0}, {1, 0, 0}, {0, 0, -1}, kHalfWidth,
                                kHalfLength);
}

TEST(FingerContact, AtTheCentreTheWidthEqualsTheBarAndTheSlopeIsZero) {
  const FingerContact s = at_height(0);
  EXPECT_NEAR(s.high - s.low, 2 * kRadius, 1e-4);
  EXPECT_NEAR(s.slope, 0, 0.05);
  EXPECT_NEAR(s.face, 2 * kHalfWidth, 1.1e-3);
}

//   | |
//  ( _ )   the ends of the pads touch only the top and slip off
TEST(FingerContact, AtTheTopTheSurfaceSlopes) {
  const FingerContact s = at_height(kRadius);
  EXPECT_LT(s.high - s.low, 1.9 * kRadius);
  EXPECT_GT(s.slope, 0.5);
  // narrower towards the tips: closing pulls the bar into the hand
  EXPECT_LT(at_height(-kRadius).slope, -0.5);
}

TEST(FingerContact, SlopeIsInfiniteForOneRowOfPoints) {
  const std::vector<Vec3> row{{0, -0.01, 0}, {0, 0.01, 0}, {0.005, -0.01, 0}, {0.005, 0.01, 0}};
  const FingerContact s =
      measure_finger_contact(row, {}, {0, 1, 0}, {1, 0, 0}, {0, 0, -1}, kHalfWidth, kHalfLength);
  EXPECT_TRUE(std::isinf(s.slope));
}

TEST(FingerContact, ThePointsBetweenThePlanesOfThePadsGiveTheSameBits) {
  const std::vector<Vec3> points = bar();
  std::vector<Vec3> some;
  for (int k = 0; k < 24; ++k) {
    const double a = 2 * std::numbers::pi * k / 24, along = 0.001 * (k - 12);
    const Vec3 approach{0, std::sin(a), -std::cos(a)}, close{0, std::cos(a), std::sin(a)};
    points_between(points, approach, along - kHalfLength, along + kHalfLength, some);
    EXPECT_LT(some.size(), points.size());
    FingerContact of[2];
    for (int i = 0; i < 2; ++i)
      of[i] = measure_finger_contact(i == 0 ? points : some, along * approach, close, {1, 0, 0},
                                     approach, kHalfWidth, kHalfLength);
    EXPECT_EQ(of[0].low, of[1].low) << k;
    EXPECT_EQ(of[0].high, of[1].high) << k;
    EXPECT_EQ(of[0].face, of[1].face) << k;
    EXPECT_EQ(of[0].slope, of[1].slope) << k;
  }
}

}  // namespace
}  // namespace mjsense::tasks::policies
