// SPDX-License-Identifier: Apache-2.0
#pragma once
// Ways of a robot's base over a floor: A* over places and headings, then straightened.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mjsense/scenes/occupancy.h"

namespace mjsense {

struct BasePose {
  double x = 0, y = 0, yaw = 0;  // m, m, rad, world
};

struct BaseRouteCfg {
  double step = 0.1;      // m, of the lattice of places; headings are multiples of 45 degrees
  double margin = 0.05;   // m, kept from everything
  double comfort = 0.25;  // m, below which being near something costs
  bool sideways = true;   // moves in every direction whatever the heading; else along it alone
};

// A lattice of where a base may stand; queries are const and may run in parallel.
class BaseRoutes {
 public:
  BaseRoutes(const Occupancy& floor, const Footprint& footprint, const BaseRouteCfg& cfg = {});

  bool free(const BasePose& pose) const {
    return footprint_.fits(floor_, pose.x, pose.y, pose.yaw, cfg_.margin);
  }
  // Straight from one to the other, turning evenly the short way.
  bool free_between(const BasePose& from, const BasePose& to) const;

  // From `from` to the first place of the lattice that `wanted` accepts, in the order of the cost of
  // the way: metres, more where the base does not face where it goes, turns, and is near something.
  // `at_least(x, y)`: no less than this many metres are left from there (0 is always right). The way
  // begins with `from`; turns in place are two poses at one place. Empty: there is none.
  std::vector<BasePose> find(const BasePose& from,
                             const std::function<bool(const BasePose&)>& wanted,
                             const std::function<double(double x, double y)>& at_least) const;
  // To one pose.
  std::vector<BasePose> find(const BasePose& from, const BasePose& to) const;

 private:
  static constexpr int kHeadings = 8;
  int columns_, rows_;
  double x0_, y0_;
  std::size_t node(int column, int row, int heading) const {
    return (static_cast<std::size_t>(row) * columns_ + column) * kHeadings + heading;
  }
  BasePose pose(std::size_t node) const;
  std::vector<BasePose> straightened(const std::vector<BasePose>& way) const;
  bool leg(const BasePose& from, const BasePose& to, std::vector<BasePose>& out) const;

  Occupancy floor_;
  Footprint footprint_;
  BaseRouteCfg cfg_;
  std::vector<float> clearance_;  // [nodes] m beyond the margin; negative: the base does not fit
};

// Moments (s) at which a base passes poses between those of the way, `dt` apart: each leg begins and
// ends at rest, within speeds (m/s, rad/s) and accelerations (m/s^2, rad/s^2).
struct BaseSpeeds {
  double speed = 0.5, turn = 0.8;
  double acceleration = 0.5, turn_acceleration = 1.0;
};
struct TimedBasePose {
  double time;
  BasePose pose;
};
std::vector<TimedBasePose> timed(std::span<const BasePose> way, const BaseSpeeds& speeds,
                                 double dt = 0.1);

// An angle in [-pi, pi].
double wrapped(double angle);

}  // namespace mjsense
