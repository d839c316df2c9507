// SPDX-License-Identifier: Apache-2.0
#pragma once
// The robot that a scene brings along: whatever of it has actuators. It needs no description of its
// own; commands are its actuators' controls, and between commands they stay as they are.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/robots/robot_cfg.h"

namespace mjsense {

// (move group, patterns of the local names of its actuators)
using ActuatorGroups = std::vector<std::pair<std::string, std::vector<std::string>>>;

// Of the entity, or of the whole model if it is "". Its base is the entity's mocap body, else its
// first body, else the world. Move groups: "base", then `groups`, or "joints" of all actuators;
// a group has the hinges and slides that its actuators drive, "joints" all there are. Throws
// KeyError for an entity that the scene has not, ValueError for patterns that match nothing or what
// another has matched; `place` starts the message.
RobotCfg scene_robot(const mjModel* model, const std::string& entity, const ActuatorGroups& groups,
                     std::string_view place);

}  // namespace mjsense
