// SPDX-License-Identifier: Apache-2.0
#pragma once
// Instructions of the pick-and-place tasks in other words.

#include <cstddef>
#include <string>

#include "mjsense_tasks/scenes/episode_scene.h"
#include "mjsense_tasks/tasks/pick_and_place/place_kind.h"

namespace mjsense::tasks {

std::size_t num_placing_sentences();
// Sentence `index`, such as "Put the mug next to the plate". `where`: reference to the receptacle.
std::string placing_sentence(std::size_t index, PlaceKind kind, const std::string& object,
                             const std::string& where, const scenes::SceneObject& receptacle);

}  // namespace mjsense::tasks
