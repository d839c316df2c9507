// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/scene_split.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense_tasks/scenes/object_catalogue.h"

namespace mjsense::tasks::scenes {
namespace {

// With this seed 2 of the 8 kinds of the table are in kTest, and about a quarter of all kinds.
constexpr std::uint64_t kSeed = 17;
constexpr double kTestKinds = 0.25;
constexpr double kTrainBrightness = 0.8;  // share of the range
constexpr int kEvery = 5;                 // one of this many houses is in kTest

const CatalogueObjectCfg* catalogue_object(std::string_view name) {
  const std::vector<CatalogueObjectCfg>& objects = object_catalogue().objects;
  const auto found = std::ranges::find(objects, name, &CatalogueObjectCfg::name);
  return found == objects.end() ? nullptr : &*found;
}

// Whether the entity is an object of the other split. Furniture is in both.
bool is_of_other_split(const std::string& entity, const SceneFileCfg& cfg, SceneSplit split) {
  const CatalogueObjectCfg* known = catalogue_object(entity);
  const auto own = std::ranges::find_if(cfg.objects, [&](const SceneObjectCfg& object) {
    return object.body.starts_with(entity + "/");
  });
  const bool listed = own != cfg.objects.end();
  if ((!known && !listed) || (known && known->receptacle) || (listed && own->receptacle))
    return false;
  return !has_kind(split, known ? known->kind : entity);
}

// Position of the '@' before the name of a split; folders may contain others.
std::size_t split_mark(std::string_view name) { return name.find('@', name.rfind('/') + 1); }

}  // namespace

std::optional<SceneSplit> cut_split(std::string_view& name) {
  const std::size_t at = split_mark(name);
  if (at == std::string_view::npos) return {};
  const std::string_view word = name.substr(at + 1);
  for (SceneSplit split : {SceneSplit::kTrain, SceneSplit::kTest}) {
    if (word != enum_name(split)) continue;
    name = name.substr(0, at);
    return split;
  }
  throw_unknown(fmt::format("scene '{}'", name), "split", std::string(word),
                std::vector<std::string>{"train", "test"});
}

std::string name_of_split(std::string_view scene, std::string_view split) {
  if (split_mark(scene) != std::string_view::npos)
    throw ValueError(fmt::format(
        "scene '{}' already names a split, but split is '{}'; give one of them", scene, split));
  const std::size_t colon = scene.rfind(':');
  const bool house = colon != std::string_view::npos && colon + 1 < scene.size() &&
                     scene.find_first_not_of("0123456789", colon + 1) == std::string_view::npos;
  const std::size_t end = house ? colon : scene.size();
  return fmt::format("{}@{}{}", scene.substr(0, end), split, scene.substr(end));
}

bool has_kind(SceneSplit split, std::string_view kind) {
  const bool test = Rng(kSeed, 0, stream_of("scene/split"), stream_of(kind)).uniform() < kTestKinds;
  return test == (split == SceneSplit::kTest);
}

SceneFileCfg split_scene(SceneFileCfg cfg, SceneSplit split) {
  std::vector<std::string> removed;
  for (const SceneEntityCfg& entity : cfg.entities) {
    if (is_of_other_split(entity.name, cfg, split)) removed.push_back(entity.name);
  }
  const auto is_removed = [&](std::string_view entity) {
    return std::ranges::find(removed, entity) != removed.end();
  };
  std::erase_if(cfg.entities, [&](const SceneEntityCfg& e) { return is_removed(e.name); });
  std::erase_if(cfg.objects, [&](const SceneObjectCfg& object) {
    return is_removed(std::string_view(object.body).substr(0, object.body.find('/')));
  });
  const bool any = std::ranges::any_of(cfg.entities,
                                       [](const SceneEntityCfg& entity) {
                                         const auto* known = catalogue_object(entity.name);
                                         return known && !known->receptacle;
                                       }) ||
                   !std::ranges::all_of(cfg.objects, &SceneObjectCfg::receptacle);
  if (!removed.empty() && !any && cfg.catalogue.empty())
    throw ValueError(
        fmt::format("scene '{}' has no objects in its split '{}'; the other split has "
                    "all their kinds: {}",
                    cfg.name, enum_name(split), fmt::join(removed, ", ")));
  // Counts through the houses of this split: 0 to 3, 5 to 8, ...; or 4, 9, ...
  if (!cfg.generator.empty() || cfg.catalogue_count >= 0)
    cfg.house = split == SceneSplit::kTrain ? cfg.house + cfg.house / (kEvery - 1)
                                            : kEvery * cfg.house + kEvery - 1;
  for (SceneVaryCfg& vary : cfg.vary) {
    if (vary.what != VaryKind::kLight) continue;
    auto& [low, high] = vary.brightness;
    const double middle = low + kTrainBrightness * (high - low);
    (split == SceneSplit::kTrain ? high : low) = middle;
  }
  return cfg;
}

}  // namespace mjsense::tasks::scenes
