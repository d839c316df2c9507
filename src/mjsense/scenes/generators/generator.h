// SPDX-License-Identifier: Apache-2.0
#pragma once
// Scenes that a function makes: a house of a street. `generator = "kitchen"` in a scene.toml names
// one; `--scene kitchen:7` is its house 7. All worlds of a job share one house; what differs between
// episodes is the scene's `vary` and sampler, as for scenes that are written.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/scene/entity.h"
#include "mjsense/scenes/scene_file.h"

namespace mjsense {

// A number that a scene.toml may give its generator.
struct GeneratorParameter {
  std::string_view name;
  double value;               // where the scene does not say it
  std::string_view sentence;  // what it is
};

// What a generator may use: the house number and everything derived from it.
struct GeneratorInput {
  std::uint64_t number = 0;
  Rng rng;                         // seeded by the generator's name and `number`
  std::vector<double> parameters;  // in the order in which the generator lists them
};

struct Generator {
  std::string_view name;
  std::string_view sentence;
  std::vector<GeneratorParameter> parameters;
  // Makes the first entity of the scene, called `room`: its model's names are "room/...". May add to
  // `cfg` what belongs to the house: regions, objects, where the robot stands, what varies. A
  // function of `input` alone.
  ModelSource (*make)(GeneratorInput& input, SceneFileCfg& cfg);
};

// The table of ours.
std::span<const Generator> generators();

// The model of cfg.generator's house cfg.house, with what it adds to `cfg`. Throws KeyError for a
// generator or parameter that there is not.
ModelSource generate(SceneFileCfg& cfg);

}  // namespace mjsense
