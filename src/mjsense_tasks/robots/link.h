// SPDX-License-Identifier: Apache-2.0
#pragma once
// One link of a kinematic chain: a hinge or slide joint and the fixed transform before it.

#include <mujoco/mujoco.h>

#include "mjsense/core/pose.h"

namespace mjsense::tasks::robots {

struct Link {
  Pose fixed;         // from the moved frame of the previous link
  Vec3 axis, anchor;  // of the joint, in the frame after `fixed`; anchor in m
  bool slide = false;
  double zero = 0;  // qpos0 of the joint

  Link(const mjModel* model, int joint, const Pose& fixed);

  // Changes `pose` from the frame after `fixed` to the moved frame, for joint position q.
  void move(Pose& pose, double q) const;
};

}  // namespace mjsense::tasks::robots
