// SPDX-License-Identifier: Apache-2.0
#pragma once
// The hands of a robot: grippers and the groups that move them.

#include <mujoco/mujoco.h>

#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::robots {

struct Hand {
  int gripper = -1;  // group index
  // Group index of the gripper's arm, or of the gripper itself on a floating base.
  int tool = -1;

  bool floats() const { return tool == gripper; }
};

// The hands of a robot, in the order of its grippers. A gripper belongs to the arm with the same
// leaf site, else to the arm whose root body is above it. A gripper that nothing moves is omitted.
std::vector<Hand> hands_of(const Robot& robot, const mjModel* model);

// Index of the group that commands the pose of a floating base; -1: none.
int floating_base(const Robot& robot);

// Vector from the first pad of a gripper to the second, m, tool frame.
Vec3 between_pads(const mjData* data, const MoveGroup& gripper);

}  // namespace mjsense::tasks::robots
