// SPDX-License-Identifier: Apache-2.0
#pragma once
// A robot configuration made from the actuators that a scene's model already contains; no
// robot.toml is needed. Commands are the actuators' controls; without a command the controls do not
// change.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense_tasks/robots/robot_cfg.h"

namespace mjsense::tasks::robots {

// Pairs of move group name and regular expressions for the local names of its actuators.
using ActuatorGroups = std::vector<std::pair<std::string, std::vector<std::string>>>;

// Configuration of the robot that is this entity, or the whole model if `entity` is "". Its base is
// the entity's mocap body, else its first body, else the world. Its move groups are "base", then
// `groups`; without `groups`, one group "joints" of all actuators and all hinges and slides. A
// group in `groups` has the hinges and slides that its actuators drive. Throws KeyError for an
// unknown entity, and ValueError for patterns that match no actuator or one of another group;
// `context` starts the message.
RobotCfg scene_robot(const mjModel* model, const std::string& entity, const ActuatorGroups& groups,
                     std::string_view context);

}  // namespace mjsense::tasks::robots
