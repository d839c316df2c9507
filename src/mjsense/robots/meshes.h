// SPDX-License-Identifier: Apache-2.0
#pragma once
// Real meshes in the place of a robot's shapes, where an installed package or a folder has them.

#include <mujoco/mujoco.h>

#include <functional>
#include <string>

#include "mjsense/robots/robot_cfg.h"

namespace mjsense {

// What does it to a scene's spec with a robot whose names have a prefix; empty where there is no
// folder. Touch, mass and motion stay. Throws ValueError if the folder lacks a file. `robot_file`:
// of the robot, whose folder MeshesCfg::folder is relative to.
std::function<void(mjSpec* spec, const std::string& prefix)> use_meshes(
    const MeshesCfg& cfg, const std::string& robot_file);

}  // namespace mjsense
