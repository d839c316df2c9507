// SPDX-License-Identifier: Apache-2.0
#pragma once
// Robots by name and from files. A robot is a folder with a robot.toml and the MJCF files that it
// names; ours are models/robots/<name>, compiled into the library.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/robots/robot_cfg.h"

namespace mjsense {

// Of ours.
std::vector<std::string> robot_names();

// One of ours by its name, or any by the path of its file: "franka", "lab/arm/robot.toml". Throws
// KeyError with the nearest names; ValueError that says file, line and key of what is wrong.
RobotCfg robot_cfg(std::string_view name_or_path);

// The robot as one MJCF, its parts attached and its meshes in place. Throws ValueError, RuntimeError.
std::string robot_xml(const RobotCfg& cfg);

// Of a text that stands at `path`, from whose folder it names others.
RobotCfg parse_robot(std::string_view text, const std::string& path);

}  // namespace mjsense
