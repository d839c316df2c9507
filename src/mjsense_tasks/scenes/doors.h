// SPDX-License-Identifier: Apache-2.0
#pragma once
// Finds doors for walking through in any compiled model.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense::tasks::scenes {

// A leaf on a hinge with a vertical axis, higher than kMinHeight.
struct Door {
  static constexpr double kMinHeight = 1.4;  // m

  int joint = -1, body = -1;
  int handle = -1;        // body: the handle, or the leaf itself if it has none
  int handle_joint = -1;  // hinge of the handle; -1: the handle is fixed
  // hinge positions (rad); open < shut if it opens in the negative direction
  double shut = 0, open = 1;
  bool swings = false;  // opens in both directions

  // Opening fraction at this hinge position: 0 shut, 1 at the end of the range.
  double fraction(double position) const;
  double fraction(const mjModel* model, const double* qpos) const {
    return fraction(qpos[model->jnt_qposadr[joint]]);
  }
};

// Finds limited hinges with an axis within 25 degrees of the vertical whose bodies are high and
// wide enough, except bodies whose name starts with `robot_prefix` (unless that is empty). The
// handle is the first body below the leaf whose name contains handle, lever or knob; otherwise the
// first one with a hinge.
std::vector<Door> find_doors(const mjModel* model, std::string_view robot_prefix);

// Horizontal unit vector (world frame) of the motion of the leaf's centre as it begins to open.
Vec3 opening_direction(const mjModel* model, const mjData* data, const Door& door);
// Centre of the leaf, m, world frame.
Vec3 leaf_middle(const mjModel* model, const mjData* data, const Door& door);

}  // namespace mjsense::tasks::scenes
