// SPDX-License-Identifier: Apache-2.0
#pragma once
// A move group of a compiled model: its names resolved to ids and addresses.

#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense_tasks/robots/robot_cfg.h"

namespace mjsense::tasks::robots {

struct MoveGroup {
  std::string name;
  GroupKind kind = GroupKind::kArm;
  std::vector<int> joints;      // ids
  std::vector<int> qpos, dofs;  // addresses; a free joint has 7 and 6, a ball joint 4 and 3
  std::vector<int> actuators;   // empty: not actuated (e.g. a mocap base)
  std::vector<double> ctrl_low, ctrl_high;  // control ranges of the actuators
  // Format of a command: number of values and their unit, "rad", or for example "0 open .. 255
  // closed".
  int command_size = 0;
  std::string command_unit;
  std::vector<double> command_low, command_high;
  // Targets of the controller: one position for each actuator; size 0 if the controller has no
  // position targets.
  int target_size = 0;
  std::string target_unit;
  bool commands_are_targets = false;  // each number of a command is the target of an actuator
  int leaf_site = -1;                 // -1: the leaf frame is the base frame
  int root_body = -1;
  // Grippers only.
  double open_command = 0, closed_command = 0, max_opening = 0;
  int pad_sites[2] = {-1, -1};

  bool controlled() const { return command_size > 0; }
  // True if there is one target for each value of qpos, so that both can be compared.
  bool targets_are_qpos() const {
    return target_size > 0 && target_size == static_cast<int>(qpos.size());
  }
};

// Resolves the names of `cfg` in `model`, each with `prefix` before it. Throws KeyError for an
// unknown name and ValueError for an invalid configuration; both messages begin with `context`.
MoveGroup resolve_group(const MoveGroupCfg& cfg, const mjModel* model, const std::string& prefix,
                        const std::string& context);

// Distance between the pads of a gripper, m; and whether it is more than half of max_opening.
double gripper_opening(const MoveGroup& gripper, const World& world);
bool gripper_is_open(const MoveGroup& gripper, const World& world);

}  // namespace mjsense::tasks::robots
