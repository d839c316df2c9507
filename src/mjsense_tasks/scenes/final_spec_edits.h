// SPDX-License-Identifier: Apache-2.0
#pragma once
// Final changes to the spec of a complete scene (room, objects and robot) before compilation: light
// and sky, a plinth under a raised pedestal, and collisions between robots and the furniture of
// third-party scenes.

#include <mujoco/mujoco.h>

#include <string>

#include "mjsense_tasks/scenes/scene_file.h"

namespace mjsense::tasks::scenes {

// `robot`: name of its entity.
void finish_spec(mjSpec* spec, const SceneFileCfg& cfg, const std::string& robot);

}  // namespace mjsense::tasks::scenes
