// SPDX-License-Identifier: Apache-2.0
#pragma once
// Loads camera systems from files. The systems of a robot are cameras/<name>.toml in the folder of
// its robot.toml.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense_tasks/cameras/camera_system.h"

namespace mjsense::tasks::cameras {

// Names of the camera systems of the robot with this file ("embedded:robots/franka/robot.toml", or
// a path).
std::vector<std::string> camera_system_names(std::string_view robot_file);

// Loads a camera system of this robot by its name, one of another built-in robot ("franka/droid"),
// or one by its path, which ends in .toml. A path that ends in .json contains the cameras of a
// recorded episode (frozen_cameras.h), for a robot whose names begin with `prefix`. Throws KeyError
// with the nearest names, or ValueError with the file, line and key of the error.
CameraSystemCfg load_camera_system(std::string_view name_or_path, std::string_view robot_file,
                                   std::string_view prefix = "");

}  // namespace mjsense::tasks::cameras
