// SPDX-License-Identifier: Apache-2.0
#pragma once
// Scenes by name and from files: ours are models/scenes/<name>/scene.toml.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/episode/task.h"
#include "mjsense/scenes/scene_file.h"

namespace mjsense {

// Of ours.
std::vector<std::string> scene_names();

// One of ours by its name, one of a scene.toml by its path, or an MJCF by its path (.xml): the whole
// model, its bodies as they lie there. "kitchen:7" is house 7 of a scene with a generator. Throws KeyError with the nearest names; ValueError that says
// file, line and key of what is wrong.
SceneFileCfg load_scene(std::string_view name_or_path);

// The scene that a task is played in: the one that its configuration makes or names, else its `own`.
SceneFileCfg task_scene(const TaskCfg& cfg, std::string_view own);

}  // namespace mjsense
