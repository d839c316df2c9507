// SPDX-License-Identifier: Apache-2.0
// The part of HandleReach for floating grippers. The tool moves on screws and can reach every pose.

#include <algorithm>
#include <cmath>

#include "mjsense/core/model_geometry.h"
#include "mjsense_tasks/tasks/opening/handle_reach.h"

namespace mjsense::tasks {

Pose HandleReach::base_with(const OrientedHand& hand, const Pose& tool) const {
  const robots::RobotValues none;
  return tool * inverse(robot_.fk(hand.gripper, none));
}

void HandleReach::float_to(mjData* data, const OrientedHand& hand, const Pose& tool) const {
  const Pose base = base_with(hand, tool);
  double* qpos = data->qpos + free_qpos(own_.get(), robot_.base_body());
  write_vec(base.p, qpos);
  write_quat(base.q, qpos + 3);
}

bool HandleReach::screw_is_free(mjData* data, const Start& start, const OrientedHand& hand,
                                const Pose& from, const Pose& to) const {
  const Twist screw = log6(inverse(from) * to);
  const double length = std::max(norm(screw.v), 0.2 * norm(screw.w));
  const int steps = std::max(1, static_cast<int>(std::ceil(length / cfg_.line_step)));
  for (int k = steps; k > 0; --k) {  // start at the end, which is most likely blocked
    float_to(data, hand, from * exp6((static_cast<double>(k) / steps) * screw));
    if (!free(data, start, cfg_.clearance)) return false;
  }
  return true;
}

// Finds a path to the pregrasp: a straight one, or one through a via point behind the pregrasp.
bool HandleReach::try_floating(mjData* data, const Start& start, const Pose& base,
                               const HandleMotion& motion, HandlePath& path) const {
  for (int k = 0; k < cfg_.points; ++k) {
    const double part = static_cast<double>(k) / (cfg_.points - 1);
    write_state(data, start, *motion.one, std::lerp(motion.from, motion.to, part));
    float_to(data, path.hand, motion.at(part) * path.grasp);
    if (!free(data, start, cfg_.contact, grasp_of(path.hand, *motion.one))) return false;
  }
  write_state(data, start, *motion.one, motion.from);
  path.pregrasp = path.grasp * Pose{{0, 0, -cfg_.pregrasp}, {}};
  const robots::RobotValues none;
  const Pose now = base * robot_.fk(path.hand.gripper, none);
  path.approach = {now, path.pregrasp};
  if (screw_is_free(data, start, path.hand, now, path.pregrasp)) return true;
  return std::ranges::any_of(cfg_.detours, [&](double detour) {
    const Pose by = path.pregrasp * Pose{{0, 0, -detour}, {}};
    path.approach = {now, by, path.pregrasp};
    return screw_is_free(data, start, path.hand, by, path.pregrasp) &&
           screw_is_free(data, start, path.hand, now, by);
  });
}

}  // namespace mjsense::tasks
