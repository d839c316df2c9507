// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/terrain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/config_checks.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/rng.h"
#include "mjsense/scene/terrain_tile.h"

namespace mjsense::scene {
namespace {

// The configured sub-terrains, or one of each kind.
auto sub_terrains(const TerrainCfg& cfg) {
  auto all = cfg.sub_terrains;
  for (std::size_t kind = 0; cfg.sub_terrains.empty() && kind < kEnumNames<SubTerrain>.size();
       ++kind) {
    all.emplace_back(
        kEnumNames<SubTerrain>[kind], SubTerrainCfg { .kind = static_cast<SubTerrain>(kind) });
  }
  return all;
}

// Number of columns per sub-terrain: by proportion, in order; the end of each range is rounded
// down.
std::vector<int> share_columns(const TerrainCfg& cfg, int types) {
  double total = 0;
  for (const auto& [name, sub] : cfg.sub_terrains) total += sub.proportion;
  std::vector<int> column(types);
  for (int j = 0; j < types; ++j) {
    const double x = (j + 0.5) / types * total;
    double sum = 0;
    std::size_t k = 0;
    while (k + 1 < cfg.sub_terrains.size() && (sum += cfg.sub_terrains[k].second.proportion) <= x)
      ++k;
    column[j] = static_cast<int>(k);
  }
  return column;
}

}  // namespace

void validate(const SubTerrainCfg& s, std::string_view context) {
  for (double height : s.stone_height)
    require(std::abs(height) < s.pit_depth, context, "stone_height", height, "less than pit_depth");
}

void validate(const TerrainCfg& cfg, std::string_view context) {
  const double side = std::min(cfg.tile_size[0], cfg.tile_size[1]);
  require(cfg.resolution <= side / 2, context, "resolution", cfg.resolution,
          "positive and at most half a tile (m)");
  require(cfg.max_init_level < cfg.levels, context, "max_init_level", cfg.max_init_level,
          fmt::format("less than the {} levels", cfg.levels));
  double total = 0;
  for (const auto& [name, sub] : sub_terrains(cfg)) {
    require(sub.platform_width < side || cfg.terrain_type == TerrainType::kPlane,
            fmt::format("{}: sub_terrains['{}']", context, name), "platform_width",
            sub.platform_width, fmt::format("less than the tile's {} m", side));
    total += sub.proportion;
  }
  if (total <= 0)
    throw ValueError(fmt::format("{}: the proportions of the sub-terrains add up to 0", context));
}

Terrain::Terrain(TerrainCfg cfg) : cfg_(std::move(cfg)) {
  check_fields(cfg_, "terrain");
  if (cfg_.terrain_type == TerrainType::kPlane) return;
  cfg_.sub_terrains = sub_terrains(cfg_);
  levels_ = cfg_.levels;
  types_ = cfg_.types > 0 ? cfg_.types : static_cast<int>(cfg_.sub_terrains.size());
  column_ = share_columns(cfg_, types_);
}

const std::string& Terrain::type_name(int type) const {
  return cfg_.sub_terrains[column_[type]].first;
}

void Terrain::add_to(mjSpec* spec) {
  mjsBody* body = mjs_addBody(mjs_findBody(spec, "world"), nullptr);
  mjs_setName(body->element, "terrain");
  if (levels_ == 0) {
    mjsGeom* geom = mjs_addGeom(body, nullptr);
    mjs_setName(geom->element, "terrain");
    geom->type = mjGEOM_PLANE;
    geom->size[2] = 0.01;
    return;
  }
  const auto [sx, sy] = cfg_.tile_size;
  origins_.clear();
  for (int level = 0; level < levels_; ++level) {
    const double x = levels_ == 1 ? 0.5 : level / (levels_ - 1.0);
    for (int type = 0; type < types_; ++type) {
      Tile tile{.spec = spec,
                .body = body,
                .name = fmt::format("terrain_{}_{}", level, type),
                .centre = {(level - (levels_ - 1) / 2.0) * sx, (type - (types_ - 1) / 2.0) * sy},
                .size = cfg_.tile_size,
                .difficulty = cfg_.difficulty[0] + (cfg_.difficulty[1] - cfg_.difficulty[0]) * x,
                .resolution = cfg_.resolution,
                .rng = Rng(cfg_.seed, static_cast<std::uint32_t>(level * types_ + type),
                           stream_of("terrain"), 0)};
      const double z = build_tile(cfg_.sub_terrains[column_[type]].second, tile);
      origins_.insert(origins_.end(), {tile.centre[0], tile.centre[1], z});
    }
  }
  if (const double b = cfg_.border; b > 0) {
    const double wx = levels_ * sx, wy = types_ * sy;
    const std::array<float, 4> grey{0.5f, 0.5f, 0.5f, 1.0f};
    add_box(body, "terrain_border", {0, -(wy + b) / 2}, {wx + 2 * b, b}, -1, 0, grey);
    add_box(body, "terrain_border_1", {0, (wy + b) / 2}, {wx + 2 * b, b}, -1, 0, grey);
    add_box(body, "terrain_border_2", {-(wx + b) / 2, 0}, {b, wy}, -1, 0, grey);
    add_box(body, "terrain_border_3", {(wx + b) / 2, 0}, {b, wy}, -1, 0, grey);
  }
}

std::vector<int> Terrain::env_tiles(int num_worlds) const {
  std::vector<int> tiles(2 * num_worlds);
  if (levels_ == 0) return tiles;
  const int top = cfg_.max_init_level < 0 ? levels_ - 1 : cfg_.max_init_level;
  for (int i = 0; i < num_worlds; ++i) {
    Rng rng(cfg_.seed, static_cast<std::uint32_t>(i), stream_of("terrain level"), 0);
    tiles[2 * i] = static_cast<int>(rng.below(top + 1));
    tiles[2 * i + 1] = static_cast<int>(static_cast<std::int64_t>(i) * types_ / num_worlds);
  }
  return tiles;
}

std::vector<double> Terrain::env_origins(int num_worlds, double env_spacing) const {
  std::vector<double> origins(3 * num_worlds);
  if (levels_ > 0) {
    const std::vector<int> tiles = env_tiles(num_worlds);
    for (int i = 0; i < num_worlds; ++i) {
      std::copy_n(origins_.begin() + 3 * (tiles[2 * i] * types_ + tiles[2 * i + 1]), 3,
                  origins.begin() + 3 * i);
    }
    return origins;
  }
  // Grid centred on the world origin: row i / cols along -x, column i % cols along +y.
  const int root = static_cast<int>(std::sqrt(num_worlds));
  const int rows = (num_worlds + root - 1) / root;
  const int cols = (num_worlds + rows - 1) / rows;
  for (int i = 0; i < num_worlds; ++i) {
    origins[3 * i] = -(i / cols - (rows - 1) / 2.0) * env_spacing;
    origins[3 * i + 1] = (i % cols - (cols - 1) / 2.0) * env_spacing;
  }
  return origins;
}

}  // namespace mjsense::scene
