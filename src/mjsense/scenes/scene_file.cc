// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/scene_file.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

void check_area(const std::array<double, 4>& area, const std::string& who) {
  if (area == std::array<double, 4>{}) return;
  if (!(area[0] <= area[1] && area[2] <= area[3]))
    throw ValueError(fmt::format("{} is {}, {}, {}, {}: least x, most x, least y, most y", who,
                                 area[0], area[1], area[2], area[3]));
}

void check_sizes(const std::array<double, 2>& sizes, const std::string& who) {
  if (sizes[0] > sizes[1])
    throw ValueError(fmt::format("{}: sizes is {}, {}: least, most", who, sizes[0], sizes[1]));
}

}  // namespace

void validate(const SceneFileCfg& cfg, std::string_view place) {
  const std::string who = fmt::format("{}{}scene '{}'", place, place.empty() ? "" : ", ", cfg.name);
  if (cfg.name.empty()) throw ValueError(who + ": it has no name");
  if (!cfg.generator.empty() && !cfg.base.empty())
    throw ValueError(who + ": it has a generator and a base; a generated room is an entity");
  if (cfg.models && !(cfg.base.empty() && cfg.entities.empty() && cfg.generator.empty()))
    throw ValueError(who + ": code makes its models: no base, entities or generator, too");
  for (std::size_t i = 0; i < cfg.entities.size(); ++i) {
    if (!cfg.generator.empty() && cfg.entities[i].name == "room")
      throw ValueError(who + ": entity 'room' is the one that its generator makes");
    for (std::size_t k = 0; k < i; ++k) {
      if (cfg.entities[i].name == cfg.entities[k].name)
        throw ValueError(
            fmt::format("{}: two entities are called '{}'", who, cfg.entities[i].name));
    }
  }
  for (const SceneRegionCfg& region : cfg.regions) {
    check_area(region.area, fmt::format("{}, region '{}': area", who, region.name));
    if (region.target_area)
      check_area(*region.target_area,
                 fmt::format("{}, region '{}': target_area", who, region.name));
  }
  if (cfg.count[0] > cfg.count[1] || cfg.count[0] == 0 || cfg.count[0] < -1)
    throw ValueError(fmt::format("{}: count is {}, {}: least, most, from 1 on (or -1, -1)", who,
                                 cfg.count[0], cfg.count[1]));
  check_sizes(cfg.sizes, who);
  for (const SceneObjectCfg& object : cfg.objects) {
    if (object.sizes) check_sizes(*object.sizes, fmt::format("{}, object '{}'", who, object.body));
  }
  for (const SceneVaryCfg& vary : cfg.vary) {
    const std::string what = fmt::format("{}, vary {} '{}'", who, vary.what.text(), vary.pattern);
    if (vary.brightness[0] > vary.brightness[1])
      throw ValueError(fmt::format("{}: brightness is from {} to {}: least first", what,
                                   vary.brightness[0], vary.brightness[1]));
    if (vary.what != VaryKind::kMaterial && !vary.textures.empty())
      throw ValueError(what + ": textures are for materials");
    const bool stands = vary.what == VaryKind::kLight || vary.what == VaryKind::kBody;
    if (!stands && (vary.pos != std::array<double, 3>{} || vary.angle > 0))
      throw ValueError(what + ": pos and angle are for lights and bodies");
    const bool colours =
        vary.brightness != std::array<double, 2>{1, 1} || vary.hue > 0 || vary.saturation > 0;
    if (vary.what == VaryKind::kBody && colours)
      throw ValueError(what + ": brightness, hue and saturation are not for bodies");
  }
}

}  // namespace mjsense
