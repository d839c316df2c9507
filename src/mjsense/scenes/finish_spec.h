// SPDX-License-Identifier: Apache-2.0
#pragma once
// What is done to the spec of a whole scene - room, things and robot - before it is compiled: light and sky,
// a plinth under a raised pedestal, and that the furniture of others touches robots.

#include <mujoco/mujoco.h>

#include <string>

#include "mjsense/scenes/scene_file.h"

namespace mjsense {

// `robot`: the name of its entity.
void finish_spec(mjSpec* spec, const SceneFileCfg& cfg, const std::string& robot);

}  // namespace mjsense
