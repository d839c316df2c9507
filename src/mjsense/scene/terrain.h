#pragma once
// The ground of a scene.

#include <string>

namespace mjsense {

struct TerrainCfg {
  std::string terrain_type = "plane";  // plane generator
};

}  // namespace mjsense
