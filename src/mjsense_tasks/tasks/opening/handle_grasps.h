// SPDX-License-Identifier: Apache-2.0
#pragma once
// Grasp poses for the handles of drawers and doors.

#include <mujoco/mujoco.h>

#include <vector>

#include "mjsense_tasks/robots/hands.h"
#include "mjsense_tasks/tasks/opening/articulation.h"

namespace mjsense::tasks {

struct OrientedHand : robots::Hand {
  Quat turn;  // from a tool frame whose fingers close along y to the gripper's own tool frame
};
// The hands of a robot, in its order.
std::vector<OrientedHand> oriented_hands(const robots::Robot& robot, const mjModel* model);

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
