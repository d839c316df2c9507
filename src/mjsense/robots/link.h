// SPDX-License-Identifier: Apache-2.0
#pragma once
// A hinge or slide between two bodies, as chains of them are made of.

#include <mujoco/mujoco.h>

#include "mjsense/core/pose.h"

namespace mjsense {

struct Link {
  Pose fixed;         // from the moved frame of the one before
  Vec3 axis, anchor;  // of the joint, in the frame after `fixed`
  bool slide = false;
  double zero = 0;  // qpos0

  Link(const mjModel* model, int joint, const Pose& fixed);

  // From the pose of the frame after `fixed` to that of the moved frame, the joint at q.
  void move(Pose& pose, double q) const;
};

}  // namespace mjsense
