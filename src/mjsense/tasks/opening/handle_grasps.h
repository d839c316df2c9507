// SPDX-License-Identifier: Apache-2.0
#pragma once
// How a hand takes the handle of a drawer or a door.

#include <mujoco/mujoco.h>

#include <vector>

#include "mjsense/robots/robot.h"
#include "mjsense/tasks/opening/articulation.h"

namespace mjsense {

// An arm and its gripper: move groups of a robot. A hand that floats is both.
struct ArmAndHand {
  int arm = -1, gripper = -1;
  Quat turn;  // from a tool frame whose fingers close along y to the hand's own
  bool floats() const { return arm == gripper; }
};
// Those whose gripper is an arm's leaf, or hangs on a base that floats, in the robot's order.
std::vector<ArmAndHand> arms_with_hands(const Robot& robot, const mjModel* model);

// Where the tool takes a handle: z the approach, y the closing direction, the origin between the
// finger tips.
struct HandleGrasp {
  Pose pose;  // X_WT
  double cost = 0;
};
// By rising cost: straight on in the middle first, then from other sides and places. `body` is the
// pose of the handle's body.
std::vector<HandleGrasp> propose_handle_grasps(const Handle& handle, const Pose& body,
                                               double max_opening);

}  // namespace mjsense
