// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base placement: writes the state that puts a robot's base at a pose in the world.

#include <mujoco/mujoco.h>

#include <span>
#include <string>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense_tasks/robots/link.h"
#include "mjsense_tasks/robots/state_row.h"

namespace mjsense::tasks::robots {

// The base is moved by the first of these that the model has:
//   1. its free joint;
//   2. the joints of the base's move group (slides and hinges of a mobile base), as far as they can
//      reach the pose; the rest by 3;
//   3. the mocap body that is the base or its ancestor (a scene attaches a robot without a free
//      joint to one).
class BasePlacement {
 public:
  BasePlacement() = default;
  // `joints`: ids of the joints of the base's move group. `context` starts the messages of errors.
  BasePlacement(const mjModel* model, int base_body, std::span<const int> joints,
                std::string context);

  // Throws ValueError if the base cannot be put there; the message says how to make it placeable.
  void write(const StateRow& state, const Pose& base) const;

 private:
  void move_joints(const StateRow& state, const Pose& base) const;
  double missing_motion(const StateRow& state, std::size_t joint, const Pose& base) const;
  Pose from_root(const StateRow& state) const;  // X_RB

  std::string context_, base_name_;
  std::string fault_;  // why the base cannot be placed; empty if it can
  int free_qpos_ = -1, free_dof_ = -1;
  int mocap_ = -1;
  bool is_mocap_ = false;  // the base itself is the mocap body
  Pose root_;              // X_WR in the model; R: the mocap body, or the world if there is none
  std::vector<Link> links_;
  Pose tail_;
  std::vector<int> qpos_, dofs_;  // addresses, per link
};

}  // namespace mjsense::tasks::robots
