// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads [[sensors]] of a robot.toml: built-in sensors by kind and fields, and Python classes.
//
//   [[sensors]]
//   kind = "contact"
//   name = "finger_contact"
//   primary = { mode = "body", pattern = ["left", "right"] }
//
//   [[sensors]]
//   kind = "python"
//   name = "grip_force"
//   class = "my_lab.sensors:GripForce"
//   args = { gain = 2.5 }
//
// A reference without `entity` refers to the robot, except in `secondary`, where it refers to the
// whole scene.

#include "mjsense/core/fields/toml_value.h"
#include "mjsense_tasks/robots/robot_cfg.h"

namespace mjsense::tasks::robots {

// Moves the [[sensors]] tables from `file` to `cfg`. Throws ValueError with file, line and key.
void take_robot_sensors(toml::table& file, const std::string& path, RobotCfg& cfg);

}  // namespace mjsense::tasks::robots
