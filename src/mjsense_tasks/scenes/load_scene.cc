// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/load_scene.h"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <optional>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/toml_fields.h"
#include "mjsense/core/files/data_file.h"
#include "mjsense_tasks/scenes/object_catalogue.h"
#include "mjsense_tasks/scenes/scene_split.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr DataFolder kScenes{"scene", "scenes/", "/scene.toml", true};
constexpr int kMaxBases = 8;

void read(const DataFile& file, SceneFileCfg& cfg, int depth) {
  SceneFileCfg own;
  read_toml_fields(file.text, file.path, own);
  if (!own.extends.empty()) {
    if (depth == kMaxBases)
      throw ValueError(fmt::format("{}: the scenes extend each other in a cycle", file.path));
    const bool is_path = own.extends.ends_with(".toml");
    read(kScenes.find(is_path ? resolve_relative(file.path, own.extends) : own.extends), cfg,
         depth + 1);
    for (SceneVaryCfg& vary : cfg.vary) vary.optional = true;
  }
  const std::vector<SceneVaryCfg> inherited = cfg.vary;
  read_toml_fields(file.text, file.path, cfg);
  // The entries of `vary` follow those of the base. `vary = []` removes the base's: then `own.vary`
  // and `cfg.vary` are both empty.
  if (!own.vary.empty()) cfg.vary.insert(cfg.vary.begin(), inherited.begin(), inherited.end());
  // Paths in the file are relative to its folder.
  if (!own.entities.empty()) {
    for (SceneEntityCfg& entity : cfg.entities)
      entity.model = resolve_relative(file.path, entity.model);
  }
  if (!own.base.empty()) cfg.base = resolve_relative(file.path, own.base);
}

// Removes the suffix ":7" and returns the number; empty if there is no such suffix.
std::optional<int> cut_house(std::string_view& name) {
  const std::size_t colon = name.rfind(':');
  if (colon == std::string_view::npos || colon == 0 || colon + 1 == name.size()) return {};
  int house = 0;
  const auto [end, error] =
      std::from_chars(name.data() + colon + 1, name.data() + name.size(), house);
  if (error != std::errc() || end != name.data() + name.size() || house < 0) return {};
  name = name.substr(0, colon);
  return house;
}

}  // namespace

std::vector<std::string> scene_names() { return kScenes.names(); }

SceneFileCfg load_scene(std::string_view name) {
  SceneFileCfg cfg;
  const std::optional<int> house = cut_house(name);
  const std::optional<SceneSplit> split = cut_split(name);
  if (name.ends_with(".xml")) {
    cfg.base = std::string(name);
    if (!std::filesystem::is_regular_file(cfg.base))
      throw ValueError(fmt::format("{}: no such file", cfg.base));
    cfg.name = std::filesystem::path(cfg.base).stem().string();
  } else {
    read(kScenes.find(name), cfg, 0);
  }
  if (house) cfg.house = *house;
  const bool has_houses = !cfg.generator.empty() || cfg.catalogue_count >= 0;
  if ((!has_houses && (house || cfg.house > 0)) ||
      (cfg.generator.empty() && !cfg.parameters.empty()))
    throw ValueError(fmt::format("scene '{}' has no generator, so {} have no effect", name,
                                 cfg.parameters.empty() ? "houses" : "parameters"));
  check_fields(cfg, fmt::format("scene '{}'", name));
  if (split) cfg = split_scene(std::move(cfg), *split);
  return with_catalogue_objects(std::move(cfg), split);
}

SceneFileCfg task_scene(const episode::TaskCfg& cfg, std::string_view own) {
  if (cfg.make_scene) return with_catalogue_objects(cfg.make_scene());
  return load_scene(cfg.scene.empty() ? own : std::string_view(cfg.scene));
}

}  // namespace mjsense::tasks::scenes
