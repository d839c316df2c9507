// SPDX-License-Identifier: Apache-2.0
#pragma once
// The cameras of an episode that was recorded, where they stood: for pictures of it that are made
// again.

#include <string_view>

#include "mjsense/cameras/camera_system.h"

namespace mjsense {

// What CameraSystem::frozen() wrote, and obs_scene has under `cameras`: a system without noise.
// Bodies are the robot's, whose names there begin with `prefix`; `place`: for messages, where the
// text is from. Throws ValueError.
CameraSystemCfg read_frozen(std::string_view json, std::string_view prefix, std::string_view place);

}  // namespace mjsense
