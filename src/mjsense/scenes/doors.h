// SPDX-License-Identifier: Apache-2.0
#pragma once
// Doors that one walks through, found in a compiled model, whoever wrote it.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense {

// A leaf on a hinge about the vertical, higher than kLeastHeight.
struct Door {
  static constexpr double kLeastHeight = 1.4;  // m

  int joint = -1, body = -1;
  int handle = -1;        // body: the lever, or the leaf itself where nothing below it is a handle
  int handle_joint = -1;  // that presses it down; -1: it does not move
  double shut = 0, open = 1;  // positions of the hinge (rad); open < shut where it turns that way
  bool swings = false;        // both ways from shut

  // How far it is open at this position of its hinge: 0 shut .. 1 at the end of its range.
  double fraction(double position) const;
  double fraction(const mjModel* model, const double* qpos) const {
    return fraction(qpos[model->jnt_qposadr[joint]]);
  }
};

// Hinges with a range about an axis within 25 degrees of the vertical whose bodies are high and wide
// enough, but none whose name starts with `robot_prefix` (unless that is empty). The handle is the
// first body below the leaf that is called a handle, lever or knob; failing that, one with a hinge.
std::vector<Door> find_doors(const mjModel* model, std::string_view robot_prefix);

// Horizontal unit vector in the world along which the middle of the leaf moves as it begins to open.
Vec3 opening_direction(const mjModel* model, const mjData* data, const Door& door);
// Where the middle of the leaf is, world.
Vec3 leaf_middle(const mjModel* model, const mjData* data, const Door& door);

}  // namespace mjsense
