// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/object_catalogue.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/toml_fields.h"
#include "mjsense/core/files/data_file.h"
#include "mjsense/core/named.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense/scenes/entity_model.h"

namespace mjsense::scenes {
namespace {

constexpr DataFolder kTables{"table of objects", "objects/", ".toml"};

SceneEntityCfg entity_of(const CatalogueObjectCfg& object) {
  SceneEntityCfg entity;
  entity.name = object.name;
  entity.model = object.model;
  entity.free = !object.model.starts_with("embedded:");
  entity.hidden_group = object.hidden_group;
  entity.mass = object.mass;
  entity.friction = object.friction;
  return entity;
}

SceneObjectCfg scene_object_of(const CatalogueObjectCfg& object) {
  SceneObjectCfg one;
  one.body = object.name + "/" + object.name;
  one.text = object.text;
  one.other_texts = object.other_texts;
  one.rests = object.rests;
  one.receptacle = object.receptacle;
  one.color = object.color;
  one.material = object.material;
  one.sizes = object.sizes;
  return one;
}

// Objects that an entry denotes: the one with this name, or those that match it as a pattern and
// are not excluded.
std::vector<int> denoted(const std::string& entry, std::string_view context) {
  const std::vector<CatalogueObjectCfg>& objects = object_catalogue().objects;
  const Regex pattern(entry, context);
  std::vector<int> found;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    if (objects[i].name == entry ||
        (objects[i].excluded.empty() && pattern.fullmatch(objects[i].name)))
      found.push_back(static_cast<int>(i));
  }
  if (!found.empty()) return found;
  throw_unknown(context, "object", entry, names_of(objects, &CatalogueObjectCfg::name));
}

}  // namespace

const ObjectCatalogue& object_catalogue() {
  static const ObjectCatalogue table = [] {
    ObjectCatalogue read;
    const DataFile file = kTables.find("catalogue");
    read_toml_fields(file.text, file.path, read);
    check_fields(read, file.path);
    for (CatalogueObjectCfg& object : read.objects) {
      if (object.model.empty()) object.model = fmt::format("embedded:objects/{}.xml", object.name);
      if (object.text.empty()) {
        object.text = object.name;
        std::ranges::replace(object.text, '_', ' ');
      }
      if (object.kind.empty()) object.kind = object.text;
    }
    return read;
  }();
  return table;
}

const ObjectSourceCfg& source_of(const CatalogueObjectCfg& object) {
  return find_named(object_catalogue().sources, &ObjectSourceCfg::name, object.source,
                    fmt::format("object '{}'", object.name), "source");
}

bool is_installed(const CatalogueObjectCfg& object) {
  try {
    model_path(object.model, "");
    return true;
  } catch (const ValueError&) {
    return false;
  }
}

SceneFileCfg with_catalogue_objects(SceneFileCfg cfg, std::optional<SceneSplit> split) {
  if (cfg.catalogue.empty()) return cfg;
  const std::string context = fmt::format("scene '{}'", cfg.name);
  std::vector<int> chosen, receptacles;
  for (const std::string& entry : cfg.catalogue) {
    for (int i : denoted(entry, context)) {
      const CatalogueObjectCfg& object = object_catalogue().objects[i];
      if (split && !object.receptacle && !has_kind(*split, object.kind)) continue;
      std::vector<int>& into = object.receptacle ? receptacles : chosen;
      if (std::ranges::find(into, i) == into.end()) into.push_back(i);
    }
  }
  // Each house has other ones.
  const auto wanted = static_cast<std::size_t>(cfg.catalogue_count);
  if (cfg.catalogue_count >= 0 && wanted < chosen.size()) {
    Rng rng(0, 0, stream_of("scene/catalogue"), static_cast<std::uint64_t>(cfg.house));
    for (std::size_t i = 0; i < wanted; ++i)
      std::swap(chosen[i], chosen[i + rng.below(static_cast<std::uint32_t>(chosen.size() - i))]);
    chosen.resize(wanted);
  }
  chosen.insert(chosen.end(), receptacles.begin(), receptacles.end());
  for (int i : chosen) {
    const CatalogueObjectCfg& object = object_catalogue().objects[i];
    cfg.entities.push_back(entity_of(object));
    cfg.objects.push_back(scene_object_of(object));
  }
  cfg.catalogue.clear();
  return cfg;
}

}  // namespace mjsense::scenes
