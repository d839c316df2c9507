// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/joint_path.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mjsense::tasks::policies {
namespace {

using Config = std::span<const double>;

// A point in a square. The start is on the left, the goal on the right; the wall at |x| < 0.2 has
// one gap, y > 1.5, far from the straight line:
//
//   +-----------+
//   |    #      |
//   | s  #   g  |
//   +----#------+
JointSpace square() { return {{-2, -2}, {2, 2}, {1.0, 0.5}, {2.0, 2.0}}; }

bool clear(Config q) { return std::abs(q[0]) > 0.2 || q[1] > 1.5; }

FreeSpace wall() {
  return {clear, [](Config a, Config b) {
            for (int k = 0; k <= 2000; ++k) {
              const double s = k / 2000.0;
              const double q[2] = {a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])};
              if (!clear(q)) return false;
            }
            return true;
          }};
}

TEST(Motion, AvoidsAWallAndDependsOnlyOnTheRng) {
  const double start[2] = {-1, -1}, goal[2] = {1, -1};
  std::vector<double> first;
  for (int k = 0; k < 20; ++k) {
    Rng rng(k, 0, 0, 0), same(k, 0, 0, 0);
    const auto path = find_path(square(), start, goal, wall(), rng);
    ASSERT_GE(path.size(), 6u) << k;
    EXPECT_EQ(path, find_path(square(), start, goal, wall(), same));
    EXPECT_EQ(path[0], -1);
    EXPECT_EQ(path[path.size() - 2], 1);
    for (std::size_t i = 2; i < path.size(); i += 2) {
      EXPECT_TRUE(wall().between(Config(path).subspan(i - 2, 2), Config(path).subspan(i, 2))) << k;
    }
    double length = 0;
    for (std::size_t i = 2; i < path.size(); i += 2)
      length += std::hypot(path[i] - path[i - 2], path[i + 1] - path[i - 1]);
    EXPECT_LT(length, 1.4 * (2 * std::hypot(0.8, 2.5) + 0.4)) << "the path is shortened";
  }
}

TEST(Motion, UsesTheStraightLineIfItIsFree) {
  const double start[2] = {-1, -1}, goal[2] = {-1, 1};
  Rng rng(0, 0, 0, 0);
  EXPECT_EQ(find_path(square(), start, goal, wall(), rng), (std::vector<double>{-1, -1, -1, 1}));
}

TEST(Motion, AcceptsAnInvalidStart) {
  // The start is beyond a limit and in collision.
  const double start[2] = {-2.001, -1}, goal[2] = {1, -1};
  const FreeSpace walls = wall();
  const FreeSpace free{[&](Config q) { return q[0] > -2 && walls.at(q); }, walls.between};
  Rng rng(0, 0, 0, 0);
  const auto path = find_path(square(), start, goal, free, rng);
  ASSERT_GE(path.size(), 6u);
  EXPECT_EQ(path[0], -2.001);
}

TEST(Motion, ReturnsAnEmptyPathIfThereIsNone) {
  const double start[2] = {-1, -1}, goal[2] = {1, -1};
  const FreeSpace shut{[](Config q) { return std::abs(q[0]) > 0.2; },
                       [](Config a, Config b) { return a[0] * b[0] > 0; }};
  Rng rng(0, 0, 0, 0);
  EXPECT_TRUE(find_path(square(), start, goal, shut, rng).empty());
}

// Checks finite differences of a path's points against the limits, from rest to rest.
void expect_within_limits(const JointSpace& space, const CommandPath& path) {
  const std::size_t n = space.size(), many = path.times.size();
  const double dt = path.times[1];
  for (std::size_t d = 0; d < n; ++d) {
    double before = 0;
    for (std::size_t i = 0; i < many; ++i) {
      const double next = path.points[std::min(i + 1, many - 1) * n + d];
      const double speed = (next - path.points[i * n + d]) / dt;
      EXPECT_LE(std::abs(speed), 1.001 * space.speed[d]);
      EXPECT_LE(std::abs(speed - before) / dt, 1.001 * space.acceleration[d]) << i;
      before = speed;
    }
  }
}

TEST(Motion, TimesAreWithinTheLimits) {
  const double start[2] = {-1, -1}, goal[2] = {1, -1};
  for (int k = 0; k < 10; ++k) {
    Rng rng(k, 0, 0, 0);
    const auto path = find_path(square(), start, goal, wall(), rng);
    const CommandPath timed = time_path(square(), 3, path, wall());
    EXPECT_EQ(timed.group, 3);
    expect_within_limits(square(), timed);
    for (std::size_t i = 0; i < timed.times.size(); ++i)
      EXPECT_TRUE(clear(Config(timed.points).subspan(2 * i, 2)))
          << "rounded corners stay clear of the wall";
    EXPECT_NEAR(timed.points[timed.points.size() - 2], 1, 1e-9);
  }
}

// A line of 2 rad at 1 rad/s and 2 rad/s^2 takes 2 / 1 + 1 / 2 s.
TEST(Motion, LineTakesTheTimeOfATrapezoidalProfile) {
  const JointSpace one{{-2}, {2}, {1.0}, {2.0}};
  const FreeSpace all{[](Config) { return true; }, [](Config, Config) { return true; }};
  const CommandPath timed = time_path(one, 0, std::vector<double>{-1, 1}, all);
  EXPECT_NEAR(timed.times.back(), 2.5, 0.05);
  const auto tool = [](Config q) { return Vec3{0.5 * q[0], 0, 0}; };
  EXPECT_NEAR(time_path(one, 0, std::vector<double>{-1, 1}, all, tool, 0.25).times.back(), 4.25,
              0.05);
}

}  // namespace
}  // namespace mjsense::tasks::policies
