#pragma once
// The ground of a scene.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

namespace mjsense {

struct TerrainCfg {
  std::string terrain_type = "plane";  // plane generator
};

// Adds the body "terrain" with its geoms to the world.
void add_terrain(const TerrainCfg& cfg, mjSpec* spec);

// World origins [B, 3], m.
std::vector<double> terrain_origins(const TerrainCfg& cfg, int num_worlds, double env_spacing);

}  // namespace mjsense
