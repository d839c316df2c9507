// SPDX-License-Identifier: Apache-2.0
#pragma once
// Ground of a scene: an infinite plane, or generated tiles of increasing difficulty (levels x
// types).

#include <mujoco/mujoco.h>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/fields/named_enum.h"

namespace mjsense::scene {

// clang-format off: this is a table
// flat             flat ground
// rough            height field: uniform noise in [-amplitude, amplitude], a value every `spacing`
// waves            height field: amplitude * sin along both axes, `waves` periods per tile
// slope            height field: pyramid with slope `slope` and a platform on top
// stairs           boxes: pyramid of steps of `step_height` and `step_width`, a platform on top
// stepping_stones  boxes: stones of `stone_width` with gaps of `gap` over a pit, around a platform
// clang-format on
enum class SubTerrain { kFlat, kRough, kWaves, kSlope, kStairs, kSteppingStones };
constexpr std::array<std::string_view, 6> enum_names(SubTerrain) {
  return {"flat", "rough", "waves", "slope", "stairs", "stepping_stones"};
}

struct SubTerrainCfg {
  NamedEnum<SubTerrain> kind;
  double proportion = 1.0;
  bool inverted = false;
  double platform_width = 2.0;
  std::array<double, 2> amplitude{0.01, 0.08};
  double spacing = 0.2;
  int waves = 2;
  std::array<double, 2> slope{0.0, 0.6};
  std::array<double, 2> step_height{0.03, 0.20};
  double step_width = 0.3;
  std::array<double, 2> stone_width{1.0, 0.35};
  std::array<double, 2> gap{0.05, 0.35};
  std::array<double, 2> stone_height{0.0, 0.05};
  double pit_depth = 1.0;
};
template <class V>
void visit_fields(V& v, SubTerrainCfg& c) {
  v.object("SubTerrainCfg",
           "One kind of tile. Pairs hold the value at difficulty 0 and the value at difficulty 1.");
  v("kind", c.kind, "The shape of the tile.");
  v("proportion", c.proportion, "Share of the columns that have this kind.").at_least(0);
  v("inverted", c.inverted, "slope, stairs: descend into a pit instead of rising to a platform.");
  v("platform_width", c.platform_width, "Width of the flat square at the centre.")
      .unit("m")
      .positive();
  v("amplitude", c.amplitude, "rough, waves: half of the height difference.").unit("m").at_least(0);
  v("spacing", c.spacing, "rough: distance between the random heights.").unit("m").positive();
  v("waves", c.waves, "waves: number of periods per tile.").at_least(1);
  v("slope", c.slope, "slope: rise over run.").at_least(0);
  v("step_height", c.step_height, "stairs: height of a step.").unit("m").positive();
  v("step_width", c.step_width, "stairs: depth of a step.").unit("m").positive();
  v("stone_width", c.stone_width, "stepping_stones: width of a stone.").unit("m").above(0.02);
  v("gap", c.gap, "stepping_stones: distance between stones.").unit("m").at_least(0);
  v("stone_height", c.stone_height, "stepping_stones: maximum deviation of a stone's height.")
      .unit("m");
  v("pit_depth", c.pit_depth, "stepping_stones: depth of the pit below the stones.")
      .unit("m")
      .positive();
}

// Checks relations between the fields.
void validate(const SubTerrainCfg& cfg, std::string_view context);

enum class TerrainType { kPlane, kGenerator };
constexpr std::array<std::string_view, 2> enum_names(TerrainType) { return {"plane", "generator"}; }

// Generated tiles: levels along +x with increasing difficulty, types along +y. The grid is centred
// on the world origin, and tiles meet at z = 0.
struct TerrainCfg {
  NamedEnum<TerrainType> terrain_type;
  std::vector<std::pair<std::string, SubTerrainCfg>> sub_terrains;
  int levels = 5;
  int types = 0;
  std::array<double, 2> tile_size{8.0, 8.0};
  std::array<double, 2> difficulty{0.0, 1.0};
  double resolution = 0.1;
  double border = 5.0;
  int max_init_level = -1;
  std::uint64_t seed = 0;
  bool daylight = true;
};
template <class V>
void visit_fields(V& v, TerrainCfg& c) {
  v.object("TerrainCfg",
           "The ground, registered as entity ``terrain``: a plane, or a grid of tiles of "
           "increasing difficulty (levels along x, types along y).");
  v("terrain_type", c.terrain_type, "An infinite plane, or generated tiles.");
  v("sub_terrains", c.sub_terrains, "Tile kinds by name; empty: one of each kind.");
  v("levels", c.levels, "Number of tiles along x.").at_least(1);
  v("types", c.types, "Number of columns along y; 0: one per sub-terrain.").at_least(0);
  v("tile_size", c.tile_size, "Size of a tile in x and y.").unit("m").positive();
  v("difficulty", c.difficulty, "Difficulty of the first and of the last level.");
  v("resolution", c.resolution, "Grid spacing of height fields.").unit("m").positive();
  v("border", c.border, "Width of the flat border around all tiles; 0: no border.")
      .unit("m")
      .at_least(0);
  v("max_init_level", c.max_init_level, "Highest level on which a world may start; -1: any level.")
      .at_least(-1);
  v("seed", c.seed, "Seed of the tile shapes and of the worlds' start tiles.");
  v("daylight", c.daylight,
    "Add a sun, a sky and a checkered ground where the models and ``spec_fn`` define none; lights "
    "that a robot carries, or that follow a body, do not count. False: MuJoCo's headlight is the "
    "only light that is added.");
}

void validate(const TerrainCfg& cfg, std::string_view context);

class Terrain {
 public:
  // Throws ValueError for values that check_fields() rejects.
  explicit Terrain(TerrainCfg cfg);

  // Adds the body "terrain" to the world: a plane named "terrain", or geoms named
  // "terrain_<level>_<type>", with the suffix "_<k>" for tiles of several boxes.
  void add_to(mjSpec* spec);

  int levels() const { return levels_; }  // 0 for a plane
  int types() const { return types_; }
  // Name of the sub-terrain of column `type`.
  const std::string& type_name(int type) const;
  // Spawn points [levels, types, 3], m: the centre of each tile, on its surface. Valid after
  // add_to().
  const std::vector<double>& tile_origins() const { return origins_; }

  // World origins [B, 3], m. Plane: a grid with this spacing. Generated terrain: the spawn point of
  // the world's tile. Types are distributed evenly in order; levels are drawn from the seed.
  std::vector<double> env_origins(int num_worlds, double env_spacing) const;
  // Tile [B, 2] of each world: level, type.
  std::vector<int> env_tiles(int num_worlds) const;

 private:
  TerrainCfg cfg_;
  int levels_ = 0, types_ = 0;
  std::vector<int> column_;  // index of the sub-terrain of each column
  std::vector<double> origins_;
};

}  // namespace mjsense::scene
