// SPDX-License-Identifier: Apache-2.0
#pragma once
// Grasp poses for the handles of drawers and doors.

#include <mujoco/mujoco.h>

#include <vector>

#include "mjsense/robots/robot.h"
#include "mjsense/tasks/opening/articulation.h"

namespace mjsense::tasks {

// Move groups of an arm and its gripper. A floating gripper is both (arm == gripper).
struct ArmAndHand {
  int arm = -1, gripper = -1;
  Quat turn;  // from a tool frame whose fingers close along y to the gripper's own tool frame
  bool floats() const { return arm == gripper; }
};
// All pairs in which the gripper is attached to the arm, and all floating grippers, in the robot's
// order.
std::vector<ArmAndHand> arms_with_hands(const robots::Robot& robot, const mjModel* model);

// Tool pose for grasping a handle: z is the approach direction, y the closing direction, and the
// origin lies between the finger tips.
struct HandleGrasp {
  Pose pose;  // X_WT
  double cost = 0;
};
// Grasps by increasing cost: first the straight approach at the middle of the handle, then other
// directions and positions. `body`: X_WB of the handle's body. `max_opening`: m.
std::vector<HandleGrasp> propose_handle_grasps(const Handle& handle, const Pose& body,
                                               double max_opening);

}  // namespace mjsense::tasks
