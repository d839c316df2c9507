// SPDX-License-Identifier: Apache-2.0
#pragma once
// [[sensors]] of a robot.toml: sensors of the scene by their kind and fields, and classes of Python's.
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
// Elements without an `entity` are the robot's, except those of `secondary`, which are the scene's.

#include "mjsense/core/toml_value.h"
#include "mjsense/robots/robot_cfg.h"

namespace mjsense {

// Takes the tables out of the file. ValueError that says file, line and key of what is wrong.
void take_robot_sensors(toml::table& file, const std::string& path, RobotCfg& cfg);

}  // namespace mjsense
