#pragma once
// The ground of a scene: an infinite plane, or generated tiles of rising difficulty (levels x
// types).

#include <mujoco/mujoco.h>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mjsense {

// One kind of tile. A range is (value at difficulty 0, value at difficulty 1).
struct SubTerrainCfg {
  // flat             nothing
  // rough            height field of uniform noise in [-amplitude, amplitude], a knot every
  // `spacing` waves            height field: amplitude * sin along both axes, `waves` periods a
  // tile slope            height field: pyramid that rises to a platform with `slope` stairs boxes:
  // pyramid of steps of `step_height` and `step_width` up to a platform stepping_stones  boxes of
  // `stone_width` with gaps of `gap` over a pit, around a platform
  std::string kind = "flat";
  double proportion = 1.0;                        // share of the columns
  bool inverted = false;                          // slope, stairs: down into a pit
  double platform_width = 2.0;                    // m, the flat square at the centre of the tile
  std::array<double, 2> amplitude{0.01, 0.08};    // m, rough and waves
  double spacing = 0.2;                           // m, rough
  int waves = 2;                                  // waves
  std::array<double, 2> slope{0.0, 0.6};          // rise over run
  std::array<double, 2> step_height{0.03, 0.20};  // m
  double step_width = 0.3;                        // m
  std::array<double, 2> stone_width{1.0, 0.35};   // m
  std::array<double, 2> gap{0.05, 0.35};          // m
  std::array<double, 2> stone_height{0.0, 0.05};  // m, stones stand up to this much higher or lower
  double pit_depth = 1.0;                         // m, stepping_stones
};

// Throws ValueError that names the field.
void validate(const SubTerrainCfg& cfg, std::string_view place);

struct TerrainCfg {
  std::string terrain_type = "plane";  // plane generator

  // The generator's tiles: level i along +x with rising difficulty, type j along +y, the whole
  // centred on the world's origin, tiles meeting at z = 0.
  std::vector<std::pair<std::string, SubTerrainCfg>> sub_terrains;  // empty: one of every kind
  int levels = 5;
  int types = 0;                               // columns; 0: one for each sub-terrain
  std::array<double, 2> tile_size{8.0, 8.0};   // m
  std::array<double, 2> difficulty{0.0, 1.0};  // of the first and the last level
  double resolution = 0.1;                     // m, of height fields
  double border = 5.0;                         // m, flat, around all tiles; 0: none
  int max_init_level = -1;                     // highest level that a world starts on; -1: any
  std::uint64_t seed = 0;
};

void validate(const TerrainCfg& cfg, std::string_view place);

class Terrain {
 public:
  // Validates.
  explicit Terrain(TerrainCfg cfg);

  // Adds the body "terrain" to the world: a plane "terrain", or geoms named
  // "terrain_<level>_<type>" with "_<k>" for tiles of many boxes.
  void add_to(mjSpec* spec);

  int levels() const { return levels_; }  // 0 for a plane
  int types() const { return types_; }
  // The sub-terrain of column `type`.
  const std::string& type_name(int type) const;
  // Spawn points [levels, types, 3], m: the centre of each tile, on its surface. Valid after
  // add_to().
  const std::vector<double>& tile_origins() const { return origins_; }

  // World origins [B, 3], m. Plane: a grid with this spacing. Generated: the spawn point of the
  // world's tile; types are shared out evenly in order, levels drawn from the seed.
  std::vector<double> env_origins(int num_worlds, double env_spacing) const;
  // Tiles [B, 2] of the worlds: level, type.
  std::vector<int> env_tiles(int num_worlds) const;

 private:
  TerrainCfg cfg_;
  int levels_ = 0, types_ = 0;
  std::vector<int> column_;  // sub-terrain of each column
  std::vector<double> origins_;
};

}  // namespace mjsense
