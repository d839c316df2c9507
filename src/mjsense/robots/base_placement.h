// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where a robot stands: the state that puts its base at a pose in the world, whatever carries it.

#include <mujoco/mujoco.h>

#include <span>
#include <string>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/robots/link.h"
#include "mjsense/robots/state_row.h"

namespace mjsense {

// What may carry a base, and is used in this order:
//   its free joint;
//   the joints of the base's move group (slides and hinges: a base that drives), for what of the
//   pose they can do;
//   the mocap body that it is or hangs under, for the rest (a scene puts a robot without a free
//   joint under one).
class BasePlacement {
 public:
  BasePlacement() = default;
  // `joints`: of the base's move group.
  BasePlacement(const mjModel* model, int base_body, std::span<const int> joints,
                std::string place);

  // Throws ValueError where nothing can carry it there, which says what would.
  void write(const StateRow& state, const Pose& base) const;

 private:
  Pose from_root(const StateRow& state) const;  // X_RB

  std::string place_, base_name_;
  std::string fault_;  // why it cannot be placed
  int free_qpos_ = -1, free_dof_ = -1;
  int mocap_ = -1;
  bool is_mocap_ = false;  // the base itself
  Pose root_;              // X_WR of the model: of the mocap body, or of what stands in the world
  std::vector<Link> links_;
  Pose tail_;
  std::vector<int> qpos_, dofs_;  // of the links
};

}  // namespace mjsense
