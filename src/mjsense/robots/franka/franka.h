// SPDX-License-Identifier: Apache-2.0
#pragma once
// Franka Research 3 with a Robotiq-like gripper on a pedestal: the station of the DROID data set.

#include "mjsense/robots/robot_cfg.h"

namespace mjsense {

// The robot as it is, drawn with the shapes of its MJCF, or, where the environment variable
// MJSENSE_FRANKA_MESHES names a folder with link0.stl ... link7.stl (as the Python package
// gymnasium-robotics brings them), with these. Touch, mass and motion are the same. Throws
// ValueError if the folder lacks one.
RobotCfg franka_cfg();

// Shapes gone, meshes there. `prefix` is that of the robot's names in the spec.
void use_franka_meshes(mjSpec* spec, const std::string& prefix, const std::string& folder);

}  // namespace mjsense
