// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/generator.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"
#include "mjsense_tasks/scenes/generators/dining.h"
#include "mjsense_tasks/scenes/generators/floor.h"
#include "mjsense_tasks/scenes/generators/kitchen.h"
#include "mjsense_tasks/scenes/generators/room_with_door.h"
#include "mjsense_tasks/scenes/generators/shelf.h"
#include "mjsense_tasks/scenes/generators/table_room.h"

namespace mjsense::tasks::scenes {

std::span<const Generator> generators() {
  static const std::vector<Generator> all{dining_generator(),  floor_generator(),
                                          kitchen_generator(), room_with_door_generator(),
                                          shelf_generator(),   table_room_generator()};
  return all;
}

scene::ModelSource generate(SceneFileCfg& cfg) {
  const std::string context = fmt::format("scene '{}'", cfg.name);
  const Generator& one =
      find_named(generators(), &Generator::name, cfg.generator, context, "generator");
  const auto number = static_cast<std::uint64_t>(cfg.house);
  GeneratorInput input{number, Rng(0, 0, stream_of(fmt::format("house/{}", one.name)), number), {}};
  std::vector<std::string> known;
  for (const GeneratorParameter& parameter : one.parameters) {
    known.emplace_back(parameter.name);
    input.parameters.push_back(parameter.value);
  }
  for (const auto& [name, value] : cfg.parameters) {
    const auto at = std::ranges::find(known, name);
    if (at == known.end()) {
      throw_unknown(fmt::format("{}, generator '{}'", context, one.name), "parameter", name, known);
    }
    input.parameters[at - known.begin()] = value;
  }
  return one.make(input, cfg);
}

}  // namespace mjsense::tasks::scenes
