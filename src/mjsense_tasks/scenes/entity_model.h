// SPDX-License-Identifier: Apache-2.0
#pragma once
// Models of a scene's entities: where they are found, and the changes that the scene makes to them.

#include <mujoco/mujoco.h>

#include <memory>
#include <string>
#include <string_view>

#include "mjsense_tasks/scenes/scene_file.h"

namespace mjsense::tasks::scenes {

// Resolves the path of a model. "package:<package>/<file>" is a file of an installed Python
// package. It is searched in the folders listed in the environment variable MJSENSE_PACKAGES (set
// by the Python package), then in the active virtual environment. Any other name is returned
// unchanged. Throws ValueError that says what to install.
std::string model_path(const std::string& name, std::string_view context);

// Returns the model with the scene's changes; null if there are none. A model that begins with '<' is
// MJCF text, whose files may be files of packages. Throws ValueError, KeyError.
std::shared_ptr<mjSpec> edited_model(const SceneEntityCfg& entity, std::string_view context);

}  // namespace mjsense::tasks::scenes
