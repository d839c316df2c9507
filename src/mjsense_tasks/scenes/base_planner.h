// SPDX-License-Identifier: Apache-2.0
#pragma once
// Path planning for a mobile base on a floor: A* over positions and headings, followed by
// shortcutting.

#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense_tasks/scenes/occupancy_grid.h"

namespace mjsense::tasks::scenes {

struct BasePose {
  double x = 0, y = 0, yaw = 0;  // m, m, rad; world frame

  static BasePose of(const Pose& pose) {
    const Vec3 ahead = rotate(pose.q, {1, 0, 0});
    return {pose.p.x, pose.p.y, std::atan2(ahead.y, ahead.x)};
  }
  Pose at_height(double z) const { return {{x, y, z}, axis_angle({0, 0, 1}, yaw)}; }
};

struct BaseRouteCfg {
  double step = 0.1;      // m, grid spacing of positions; headings are multiples of 45 degrees
  double margin = 0.05;   // m, minimum distance from obstacles
  double comfort = 0.25;  // m, distance from obstacles below which the path cost increases
  bool sideways = true;   // true: omnidirectional; false: moves along its heading only
};

// State lattice of a base: collision-free positions and headings. Queries are const and
// thread-safe.
class BasePlanner {
 public:
  BasePlanner(const OccupancyGrid& floor, const Footprint& footprint, const BaseRouteCfg& cfg = {});

  bool free(const BasePose& pose) const {
    return footprint_.fits(floor_, pose.x, pose.y, pose.yaw, cfg_.margin);
  }
  // Whether the straight path between the poses is free; the yaw turns evenly in the shorter
  // direction.
  bool free_between(const BasePose& from, const BasePose& to) const;

  // Finds the cheapest path from `from` to a lattice state that `wanted` accepts. The cost is the
  // length in metres, plus costs for moving other than along the heading, for turning and for being
  // near obstacles. `at_least(x, y)` is the A* heuristic: a lower bound of the remaining cost in
  // metres (0 is always valid). The path begins with `from`; a turn in place is two poses at the
  // same position. Empty if there is no path.
  std::vector<BasePose> find(const BasePose& from,
                             const std::function<bool(const BasePose&)>& wanted,
                             const std::function<double(double x, double y)>& at_least) const;
  // Finds a path to one pose.
  std::vector<BasePose> find(const BasePose& from, const BasePose& to) const;

 private:
  static constexpr int kHeadings = 8;
  int columns_, rows_;
  double x0_, y0_;
  std::size_t node(int column, int row, int heading) const {
    return (static_cast<std::size_t>(row) * columns_ + column) * kHeadings + heading;
  }
  BasePose pose(std::size_t node) const;
  std::vector<BasePose> straightened(const std::vector<BasePose>& path) const;
  bool leg(const BasePose& from, const BasePose& to, std::vector<BasePose>& out) const;

  OccupancyGrid floor_;
  Footprint footprint_;
  BaseRouteCfg cfg_;
  std::vector<float> clearance_;  // [nodes] m beyond the margin; negative: collision
};

// Time parameterisation of a path: poses `dt` apart, with their times (s). Each segment starts and
// ends at rest and respects the limits of speed (m/s, rad/s) and acceleration (m/s^2, rad/s^2).
struct BaseSpeeds {
  double speed = 0.5, turn = 0.8;
  double acceleration = 0.5, turn_acceleration = 1.0;
};
struct TimedBasePose {
  double time;
  BasePose pose;
};
std::vector<TimedBasePose> timed(std::span<const BasePose> path, const BaseSpeeds& speeds,
                                 double dt = 0.1);

// Wraps an angle to [-pi, pi].
double wrapped(double angle);

}  // namespace mjsense::tasks::scenes
