// SPDX-License-Identifier: Apache-2.0
#pragma once
// Names of an object of a scene in instructions, with probabilities.

#include <vector>

#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/scenes/episode_scene.h"

namespace mjsense::tasks::scenes {

// The usual name has probability one half; further names have decreasing probabilities.
std::vector<episode::Referral> referring_expressions(const SceneObject& object);

}  // namespace mjsense::tasks::scenes
