// SPDX-License-Identifier: Apache-2.0
#pragma once
// Loads robots by name or from files. A robot is a folder with a robot.toml and the MJCF files that
// it names; the built-in robots are models/robots/<name>, compiled into the library.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense_tasks/robots/robot_cfg.h"

namespace mjsense::tasks::robots {

// Names of the built-in robots.
std::vector<std::string> robot_names();

// The robot with this built-in name, or with this path of a robot.toml: "franka",
// "lab/arm/robot.toml". Throws KeyError with the nearest names for an unknown name, and ValueError
// with file, line and key for an invalid file.
RobotCfg robot_cfg(std::string_view name_or_path);

// The robot as one MJCF text, with its parts attached and its meshes included. Throws ValueError
// and RuntimeError.
std::string robot_xml(const RobotCfg& cfg);

// Parses the text of a robot.toml. `path`: the path of the file; paths in it are relative to its
// folder.
RobotCfg parse_robot(std::string_view text, const std::string& path);

}  // namespace mjsense::tasks::robots
