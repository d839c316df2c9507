// SPDX-License-Identifier: Apache-2.0
#pragma once
// Noun phrases that describe one object of an episode's start and no other object that is present,
// such as "the larger bowl" or "the mug to the left of the plate". Directions are those of the
// robot at the start: left is the robot's left, and an object behind another one is farther from
// the robot.

#include <fmt/format.h>

#include <array>
#include <span>
#include <string>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/sensor.h"
#include "mjsense_tasks/scenes/episode_scene.h"

namespace mjsense::tasks::scenes {

// A group per kind of phrase: names; colour, material and size; place relative to another object or
// on a piece of furniture; extreme place among objects of the same name.
using References = std::array<std::vector<std::string>, 4>;

// `robot`: the pose of its base. `other_objects`: objects that the phrases do not mention. `far`:
// the robot is not near the objects, so that phrases do not use its directions. `clauses`: places are
// clauses, "the mug that is behind the plate", which cannot be read as the goal of a motion.
References object_references(const World& world, const EpisodeScene& scene, int object,
                             const Pose& robot, std::span<const int> other_objects = {},
                             bool far = false, bool clauses = false);

// Draws one of them, or returns "" if there is none: the kind first, with fixed weights.
std::string draw_reference(const References& references, Rng& rng);

// Whether "the <phrase>" may be used for an object with this name: they are equal, or the phrase is
// the name without its first words, or the first part of "box of tea".
bool may_be_called(std::string_view name, std::string_view phrase);

}  // namespace mjsense::tasks::scenes
