// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/scene_file.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"

namespace mjsense::tasks::scenes {
namespace {

void check_area(const std::array<double, 4>& area, const std::string& who) {
  if (area == std::array<double, 4>{}) return;
  if (!(area[0] <= area[1] && area[2] <= area[3]))
    throw ValueError(fmt::format("{} is {}, {}, {}, {}: must be min x, max x, min y, max y", who,
                                 area[0], area[1], area[2], area[3]));
}

void check_sizes(const std::array<double, 2>& sizes, const std::string& who) {
  if (sizes[0] > sizes[1])
    throw ValueError(
        fmt::format("{}: sizes is {}, {}: must be minimum, maximum", who, sizes[0], sizes[1]));
}

void check_vary(const std::vector<SceneVaryCfg>& all, const std::string& who) {
  for (const SceneVaryCfg& vary : all) {
    const std::string what = fmt::format("{}, vary {} '{}'", who, vary.what.text(), vary.pattern);
    if (vary.brightness[0] > vary.brightness[1])
      throw ValueError(fmt::format("{}: brightness is from {} to {}: the minimum must come first",
                                   what, vary.brightness[0], vary.brightness[1]));
    if (vary.what != VaryKind::kMaterial && !vary.textures.empty())
      throw ValueError(what + ": textures apply to materials only");
    if (vary.what != VaryKind::kMaterial && !vary.shows.empty())
      throw ValueError(what + ": shows applies to materials only");
    const bool stands = vary.what == VaryKind::kLight || vary.what == VaryKind::kBody;
    if (!stands && (vary.pos != std::array<double, 3>{} || vary.angle > 0))
      throw ValueError(what + ": pos and angle apply to lights and bodies only");
    if (vary.what == VaryKind::kBody && changes_colour(vary))
      throw ValueError(what + ": brightness, hue, saturation and tint do not apply to bodies");
  }
}

}  // namespace

void validate(const SceneFileCfg& cfg, std::string_view context) {
  const std::string who =
      fmt::format("{}{}scene '{}'", context, context.empty() ? "" : ", ", cfg.name);
  if (cfg.name.empty()) throw ValueError(who + ": it has no name");
  if (!cfg.generator.empty() && !cfg.base.empty())
    throw ValueError(
        who +
        ": it has both a generator and a base; a generated room is an entity, so remove the base");
  if (cfg.models && !(cfg.base.empty() && cfg.entities.empty() && cfg.generator.empty()))
    throw ValueError(
        who +
        ": a scene whose models are made by code cannot also have base, entities or a generator");
  for (std::size_t i = 0; i < cfg.entities.size(); ++i) {
    if (!cfg.generator.empty() && cfg.entities[i].name == "room")
      throw ValueError(who +
                       ": the name 'room' is reserved for the entity that the generator makes");
    for (std::size_t k = 0; k < i; ++k) {
      if (cfg.entities[i].name == cfg.entities[k].name)
        throw ValueError(fmt::format("{}: two entities are named '{}'", who, cfg.entities[i].name));
    }
  }
  for (const SceneRegionCfg& region : cfg.regions) {
    check_area(region.area, fmt::format("{}, region '{}': area", who, region.name));
    if (region.target_area)
      check_area(*region.target_area,
                 fmt::format("{}, region '{}': target_area", who, region.name));
  }
  if (cfg.count[0] > cfg.count[1] || cfg.count[0] == 0 || cfg.count[0] < -1)
    throw ValueError(
        fmt::format("{}: count is {}, {}: must be minimum, maximum, at least 1 (or -1, -1)", who,
                    cfg.count[0], cfg.count[1]));
  check_sizes(cfg.sizes, who);
  for (const SceneObjectCfg& object : cfg.objects) {
    if (object.sizes) check_sizes(*object.sizes, fmt::format("{}, object '{}'", who, object.body));
  }
  check_vary(cfg.vary, who);
  for (const SceneMoodCfg& mood : cfg.moods) {
    const std::string what = fmt::format("{}, mood '{}'", who, mood.name);
    check_vary(mood.vary, what);
    for (const SceneVaryCfg& vary : mood.vary) {
      if (vary.what == VaryKind::kBody)
        throw ValueError(what + ": a mood cannot move bodies; use the scene's 'vary'");
    }
  }
}

}  // namespace mjsense::tasks::scenes
