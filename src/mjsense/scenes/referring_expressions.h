// SPDX-License-Identifier: Apache-2.0
#pragma once
// Names of an object of a scene in instructions, with probabilities.

#include <vector>

#include "mjsense/episode/task.h"
#include "mjsense/scenes/episode_scene.h"

namespace mjsense::scenes {

// The usual name has probability one half; further names have decreasing probabilities.
std::vector<episode::Referral> referring_expressions(const SceneObject& object);

}  // namespace mjsense::scenes
