// SPDX-License-Identifier: Apache-2.0
#pragma once
// Robot state of each world at the time its last action was chosen. Relative actions are measured
// from this state.

#include <array>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/sensor.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::rollout {

class ActionLog {
 public:
  explicit ActionLog(int num_worlds) : entries_(num_worlds) {}

  struct Entry {
    bool given = false;        // false: the episode has had no action yet
    robots::RobotValues qpos;  // of all groups
    std::array<Pose, robots::RobotValues::kMaxGroups> leaf;  // X_BL of each group
  };

  void begin(int world) { entries_[world].given = false; }
  // Call before an action is applied. `world` must be fresh and show the observation that the
  // action answers.
  void remember(const World& world, const robots::Robot& robot) {
    Entry& entry = entries_[world.id];
    entry.given = true;
    robot.read_qpos(world, entry.qpos);
    for (std::size_t g = 0; g < robot.groups().size(); ++g) {
      entry.leaf[g] = robot.tcp_pose(world, static_cast<int>(g));
    }
  }
  const Entry& operator[](int world) const { return entries_[world]; }

 private:
  std::vector<Entry> entries_;
};

}  // namespace mjsense::tasks::rollout
