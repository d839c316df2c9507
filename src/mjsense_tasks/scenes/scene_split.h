// SPDX-License-Identifier: Apache-2.0
#pragma once
// The two halves of a scene for tests of generalisation, "varied_table@train" and
// "varied_table@test": no object kind, generated house or brightness of light is in both.

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense_tasks/scenes/scene_file.h"

namespace mjsense::tasks::scenes {

enum class SceneSplit { kTrain, kTest };
constexpr std::array<std::string_view, 2> enum_names(SceneSplit) { return {"train", "test"}; }

// Removes the suffix "@train" or "@test" and returns it; empty if there is no '@'. Throws KeyError
// for another suffix.
std::optional<SceneSplit> cut_split(std::string_view& name);

// The name of a part of a scene: "kitchen@train:3" of "kitchen:3". Throws ValueError if `scene` is
// already the name of a part.
std::string name_of_split(std::string_view scene, std::string_view split);

// Whether a split has objects of this kind. The choice depends only on the kind: a quarter of all
// kinds is in kTest.
bool has_kind(SceneSplit split, std::string_view kind);

// Removes the objects of the other split with their entities, renumbers the house, and narrows the
// brightness of the lights to the lower four fifths (kTrain) or the upper fifth. Receptacles stay.
// Objects that come from `catalogue` are chosen later. Throws ValueError if no object is left.
SceneFileCfg split_scene(SceneFileCfg cfg, SceneSplit split);

}  // namespace mjsense::tasks::scenes
