// SPDX-License-Identifier: Apache-2.0
#pragma once
// What each world looked like when its last action was chosen: relative actions are measured from
// there.

#include <array>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/sensor.h"
#include "mjsense/robots/robot.h"

namespace mjsense {

class ActionLog {
 public:
  explicit ActionLog(int num_worlds) : entries_(num_worlds) {}

  struct Entry {
    bool given = false;                              // false: the episode has had no action yet
    RobotValues qpos;                                // of every group
    std::array<Pose, RobotValues::kMaxGroups> leaf;  // X_BL of every group
  };

  void begin(int world) { entries_[world].given = false; }
  // Before an action is applied; `world` is fresh and shows the observation it answers.
  void remember(const World& world, const Robot& robot) {
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

}  // namespace mjsense
