// SPDX-License-Identifier: Apache-2.0
#pragma once
// A move group of a compiled model: names turned into ids and addresses.

#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/robots/robot_cfg.h"

namespace mjsense {

struct MoveGroup {
  std::string name;
  GroupKind kind = GroupKind::kArm;
  std::vector<int> joints;                  // ids
  std::vector<int> qpos, dofs;              // addresses; a free joint has 7 and 6, a ball 4 and 3
  std::vector<int> actuators;               // empty: nothing drives it (a mocap base)
  std::vector<double> ctrl_low, ctrl_high;  // of the actuators
  // What a command is: numbers of it, and their unit: "rad"; else "0 open .. 255 closed".
  int command_size = 0;
  std::string command_unit;
  std::vector<double> command_low, command_high;
  // What its controller aims at: positions for each of its actuators; 0: it aims at no positions.
  int target_size = 0;
  std::string target_unit;
  int leaf_site = -1;  // -1: the leaf is the base frame itself
  int root_body = -1;
  // Grippers only.
  double open_command = 0, closed_command = 0, max_opening = 0;
  int pad_sites[2] = {-1, -1};

  bool controlled() const { return command_size > 0; }
  // A target for each number of qpos: they can be compared.
  bool targets_are_qpos() const {
    return target_size > 0 && target_size == static_cast<int>(qpos.size());
  }
};

// Names of `cfg` in `model`, each with the prefix. Throws KeyError, or ValueError for a
// configuration that cannot be; both begin with `place`.
MoveGroup resolve_group(const MoveGroupCfg& cfg, const mjModel* model, const std::string& prefix,
                        const std::string& place);

// m between the pads of a gripper, and whether that is more than half of what is possible.
double gripper_opening(const MoveGroup& gripper, const World& world);
bool gripper_is_open(const MoveGroup& gripper, const World& world);

}  // namespace mjsense
