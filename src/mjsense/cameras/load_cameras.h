// SPDX-License-Identifier: Apache-2.0
#pragma once
// Camera systems from files. A robot has those of its folder: cameras/<name>.toml beside its
// robot.toml.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/cameras/camera_system.h"

namespace mjsense {

// Of the robot whose file this is ("embedded:robots/franka/robot.toml", or a path).
std::vector<std::string> camera_system_names(std::string_view robot_file);

// One of the robot's by its name, another robot's of ours ("franka/droid"), or any by its path, which
// ends in .toml; or the cameras of an episode, frozen in a .json (frozen_cameras.h), for a robot
// whose names begin with `prefix`. Throws KeyError with the nearest names; ValueError that says file,
// line and key of what is wrong.
CameraSystemCfg load_camera_system(std::string_view name_or_path, std::string_view robot_file,
                                   std::string_view prefix = "");

}  // namespace mjsense
