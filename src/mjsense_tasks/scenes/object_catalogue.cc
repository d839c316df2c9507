// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/object_catalogue.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/toml_fields.h"
#include "mjsense/core/files/data_file.h"
#include "mjsense/core/named.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense_tasks/scenes/entity_model.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr DataFolder kTables{"table of objects", "objects/", ".toml"};

// The MJCF of an object that consists of meshes.
std::string model_of_parts(const CatalogueObjectCfg& object) {
  std::string assets, geoms;
  for (std::size_t i = 0; i < object.parts.size(); ++i) {
    const CataloguePartCfg& part = object.parts[i];
    assets += fmt::format("<mesh name='{}' file='{}'/>", i, part.mesh);
    if (!part.texture.empty())
      assets += fmt::format("<texture name='{}' type='2d' file='{}'/>", i, part.texture);
    assets += fmt::format("<material name='{}' rgba='{}' specular='0.3' shininess='0.3'{}/>", i,
                          fmt::join(part.rgba, " "),
                          part.texture.empty() ? "" : fmt::format(" texture='{}'", i));
    const std::string pose =
        fmt::format("pos='{}' euler='{}'", fmt::join(part.pos, " "), fmt::join(part.euler, " "));
    geoms += fmt::format("<geom type='mesh' mesh='{0}' material='{0}' {1} {2}/>", i, pose,
                         part.cylinder ? "contype='0' conaffinity='0' mass='0'" : "");
    if (part.cylinder)
      geoms += fmt::format("<geom type='cylinder' size='{}' {} group='3'/>",
                           fmt::join(*part.cylinder, " "), pose);
  }
  // The contact parameters are those of the built-in objects.
  return fmt::format(
      "<mujoco model='{0}'><compiler angle='radian'/>"
      "<default><geom group='2' condim='6' solref='0.008 1'/></default>"
      "<asset>{1}</asset><worldbody><body name='{0}'>{2}</body></worldbody></mujoco>",
      object.name, assets, geoms);
}

SceneEntityCfg entity_of(const CatalogueObjectCfg& object) {
  SceneEntityCfg entity;
  entity.name = object.name;
  entity.model = object.parts.empty() ? object.model : model_of_parts(object);
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
    ObjectCatalogue all;
    for (const std::string& name : kTables.names()) {
      const DataFile file = kTables.find(name);
      ObjectCatalogue read;
      read_toml_fields(file.text, file.path, read);
      check_fields(read, file.path);
      all.sources.insert(all.sources.end(), read.sources.begin(), read.sources.end());
      all.objects.insert(all.objects.end(), read.objects.begin(), read.objects.end());
    }
    for (CatalogueObjectCfg& object : all.objects) {
      if (object.model.empty() && object.parts.empty())
        object.model = fmt::format("embedded:objects/{}.xml", object.name);
      if (object.text.empty()) {
        object.text = object.name;
        std::ranges::replace(object.text, '_', ' ');
      }
      if (object.kind.empty()) object.kind = object.text;
    }
    return all;
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
    for (const CataloguePartCfg& part : object.parts) {
      model_path(part.mesh, "");
      model_path(part.texture, "");
    }
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

}  // namespace mjsense::tasks::scenes
