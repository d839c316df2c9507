// SPDX-License-Identifier: Apache-2.0
#pragma once
// Ways through joint space: found by growing two trees towards each other (RRT-Connect: Kuffner and LaValle, ICRA
// 2000; OMPL's), shortened, rounded, and given times within the limits of the joints. All is a function of the Rng.

#include <functional>
#include <span>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/policies/planner/plan.h"

namespace mjsense {

// Of n joints.
struct JointSpace {
  std::vector<double> low, high;            // rad or m; finite
  std::vector<double> speed, acceleration;  // rad/s or m/s; per s
  std::size_t size() const { return low.size(); }
};

struct MotionCfg {
  int max_samples = 3000;
  double step = 0.6;  // rad or m, longest edge of a tree, of all joints together
  int shortcuts = 40;
  double rounding = 0.25;  // share of a leg that a corner takes at most
};

// Whether a configuration, and everything between two, is free.
struct FreeSpace {
  std::function<bool(std::span<const double>)> at;
  std::function<bool(std::span<const double>, std::span<const double>)> between;
};

// Waypoints [N, n] from `start` to `goal`, both included; none where no way is found. The straight
// line where it is free.
std::vector<double> find_path(const JointSpace& space, std::span<const double> start,
                              std::span<const double> goal, const FreeSpace& is_free, Rng& rng,
                              const MotionCfg& cfg = {});

// The waypoints with rounded corners, from rest to rest, as fast as speeds and accelerations allow, sampled
// every `dt` s: points of a CommandPath for `group`. `extra` (may be empty) is a further
// quantity along the path, in which no more than `extra_speed` a second is covered: the way of the tool.
CommandPath time_path(const JointSpace& space, int group, std::span<const double> waypoints,
                      const FreeSpace& is_free,
                      const std::function<Vec3(std::span<const double>)>& extra = {},
                      double extra_speed = 0, double dt = 0.02, const MotionCfg& cfg = {});

}  // namespace mjsense
