// SPDX-License-Identifier: Apache-2.0
#pragma once
// Joint-space motion planning: paths by RRT-Connect (Kuffner and LaValle, ICRA 2000; OMPL's
// implementation), shortened, rounded, and timed within the joints' limits. The results depend only
// on the arguments and the Rng.

#include <functional>
#include <span>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense_tasks/policies/planner/plan.h"

namespace mjsense::tasks::policies {

// Limits of n joints.
struct JointSpace {
  std::vector<double> low, high;            // rad or m; finite
  std::vector<double> speed, acceleration;  // rad/s or m/s; rad/s^2 or m/s^2
  std::size_t size() const { return low.size(); }
};

struct MotionCfg {
  int max_samples = 3000;
  double step = 0.6;  // rad or m, maximum length of a tree edge (norm over all joints)
  int shortcuts = 40;
  double rounding = 0.25;  // maximum fraction of a segment that a rounded corner uses
};

// Collision checks: of one configuration, and of the straight line between two.
struct FreeSpace {
  std::function<bool(std::span<const double>)> at;
  std::function<bool(std::span<const double>, std::span<const double>)> between;
};

// Waypoints [N, n] from `start` to `goal`, both included; the straight line if it is free; empty if
// no path is found.
std::vector<double> find_path(const JointSpace& space, std::span<const double> start,
                              std::span<const double> goal, const FreeSpace& is_free, Rng& rng,
                              const MotionCfg& cfg = {});

// Rounds the corners of the path and times it from rest to rest, as fast as speeds and
// accelerations allow, sampled every `dt` s: the points of a CommandPath for `group`. `extra` (may
// be empty) is a further quantity along the path, e.g. the tool position, whose speed is limited to
// `extra_speed` per second.
CommandPath time_path(const JointSpace& space, int group, std::span<const double> waypoints,
                      const FreeSpace& is_free,
                      const std::function<Vec3(std::span<const double>)>& extra = {},
                      double extra_speed = 0, double dt = 0.02, const MotionCfg& cfg = {});

}  // namespace mjsense::tasks::policies
