// SPDX-License-Identifier: Apache-2.0
#pragma once
// Procedural scenes: a generator makes any number of houses. `generator = "kitchen"` in a
// scene.toml selects one; `--scene kitchen:7` is its house 7. All worlds of a job share one house.
// The scene's `vary` and sampler provide the variation between episodes, as for scenes without a
// generator.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/scene/entity.h"
#include "mjsense_tasks/scenes/scene_file.h"

namespace mjsense::tasks::scenes {

// A number that a scene.toml may pass to its generator.
struct GeneratorParameter {
  std::string_view name;
  double value;               // default
  std::string_view sentence;  // description
};

// The input of a generator: the house number and everything derived from it.
struct GeneratorInput {
  std::uint64_t number = 0;
  Rng rng;                         // seeded with the generator's name and the house number
  std::vector<double> parameters;  // in the order in which the generator lists them
};

struct Generator {
  std::string_view name;
  std::string_view sentence;
  std::vector<GeneratorParameter> parameters;
  // Creates the first entity of the scene, named `room`; the model's names are "room/...". May add
  // to `cfg` what depends on the house: regions, objects, the pose of the robot, variation. Must be
  // a function of `input` only.
  scene::ModelSource (*make)(GeneratorInput& input, SceneFileCfg& cfg);
};

// Table of the built-in generators.
std::span<const Generator> generators();

// Generates house cfg.house with cfg.generator and adds to `cfg`. Throws KeyError for an unknown
// generator or parameter.
scene::ModelSource generate(SceneFileCfg& cfg);

}  // namespace mjsense::tasks::scenes
