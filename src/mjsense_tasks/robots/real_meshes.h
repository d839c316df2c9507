// SPDX-License-Identifier: Apache-2.0
#pragma once
// Replaces a robot's primitive shapes by meshes if a package or a folder provides them.

#include <mujoco/mujoco.h>

#include <functional>
#include <string>

#include "mjsense_tasks/robots/robot_cfg.h"

namespace mjsense::tasks::robots {

// Returns a function that replaces the shapes in a scene's spec, for a robot whose names have
// `prefix`; an empty function if there is no folder with meshes. Collision geoms, masses and joints
// do not change. Throws ValueError if the folder lacks a file. `robot_file`: path of the
// robot.toml; MeshesCfg::folder is relative to its folder.
std::function<void(mjSpec* spec, const std::string& prefix)> use_meshes(
    const MeshesCfg& cfg, const std::string& robot_file);

}  // namespace mjsense::tasks::robots
