// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/link.h"

namespace mjsense::tasks::robots {

Link::Link(const mjModel* model, int joint, const Pose& before)
    : fixed(before),
      axis(vec3(model->jnt_axis + 3 * joint)),
      anchor(vec3(model->jnt_pos + 3 * joint)),
      slide(model->jnt_type[joint] == mjJNT_SLIDE),
      zero(model->qpos0[model->jnt_qposadr[joint]]) {}

void Link::move(Pose& pose, double q) const {
  const double dq = q - zero;
  if (slide) {
    pose.p = pose * (dq * axis);
  } else {
    const Quat turn = axis_angle(axis, dq);
    pose = pose * Pose{anchor - rotate(turn, anchor), turn};
  }
}

}  // namespace mjsense::tasks::robots
