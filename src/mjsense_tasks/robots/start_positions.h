// SPDX-License-Identifier: Apache-2.0
#pragma once
// The start positions of a robot's joints.

#include <vector>

#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::robots {

// Writes the start positions of all groups, without noise.
inline void write_start_positions(const Robot& robot, double* qpos) {
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const std::vector<double>& init = robot.cfg().groups[g].init;
    for (std::size_t i = 0; i < init.size(); ++i) qpos[robot.groups()[g].qpos[i]] = init[i];
  }
}

}  // namespace mjsense::tasks::robots
