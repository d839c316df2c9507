// SPDX-License-Identifier: Apache-2.0
#pragma once
// The models that a scene's entities name, and what the scene changes of them.

#include <mujoco/mujoco.h>

#include <memory>
#include <string>
#include <string_view>

#include "mjsense/scenes/scene_file.h"

namespace mjsense {

// Where a model is: "package:<package>/<file>" is a file of an installed Python package, looked for in
// the folders that the environment variable MJSENSE_PACKAGES lists (the Python package sets it), then
// in the virtual environment that is active. Any other name is as it is. Throws ValueError that says
// what to install.
std::string model_path(const std::string& name, std::string_view place);

// The model as the scene wants it; null where it wants it as it is. Throws ValueError, KeyError.
std::shared_ptr<mjSpec> edited_model(const SceneEntityCfg& entity, std::string_view place);

}  // namespace mjsense
