// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads the cameras of a recorded episode, so that its images can be rendered again.

#include <string_view>

#include "mjsense_tasks/cameras/camera_system.h"

namespace mjsense::tasks::cameras {

// Reads the text of CameraSystem::frozen(), which obs_scene contains under `cameras`, as a camera
// system without noise. A camera with `"depth": true` records its depth. Bodies must be the robot's: their names in the text begin with `prefix`.
// `context` names the source of the text in messages. Throws ValueError.
CameraSystemCfg read_frozen(std::string_view json, std::string_view prefix,
                            std::string_view context);

}  // namespace mjsense::tasks::cameras
