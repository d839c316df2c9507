// SPDX-License-Identifier: Apache-2.0
#pragma once
// Loads scenes by name or from files. Built-in scenes are models/scenes/<name>/scene.toml.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/scenes/scene_file.h"

namespace mjsense::tasks::scenes {

// Names of the built-in scenes.
std::vector<std::string> scene_names();

// Loads a built-in scene by name, a scene.toml by path, or an MJCF file by path (.xml), which is
// used as a complete model with its bodies at their positions. "kitchen:7" is house 7 of a scene
// with a generator, and "table@train" and "table@test" are its splits (scene_split.h). Throws KeyError with the nearest names, or ValueError with the file, line and
// key of the fault.
SceneFileCfg load_scene(std::string_view name_or_path);

// Returns the scene that a task uses: the one that its configuration builds or names, otherwise
// `own`.
SceneFileCfg task_scene(const episode::TaskCfg& cfg, std::string_view own);

}  // namespace mjsense::tasks::scenes
