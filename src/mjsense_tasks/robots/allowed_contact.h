// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mujoco/mujoco.h>

#include "mjsense/observe/frame.h"

namespace mjsense::tasks::robots {

// The contact that a plan permits: of a gripper with what it grasps. Both are subtrees, given by their
// first body; -1 permits nothing. All other contacts of the robot with the scene are collisions.
struct AllowedContact {
  int gripper = -1;  // MoveGroup::root_body
  int object = -1;

  bool permits(const mjModel* model, int body_of_robot, int other) const {
    return observe::is_descendant_or_self(model, other, object) &&
           observe::is_descendant_or_self(model, body_of_robot, gripper);
  }
};

}  // namespace mjsense::tasks::robots
