#include "mjsense/scene/terrain.h"

#include <fmt/format.h>

#include <cmath>

#include "mjsense/core/error.h"

namespace mjsense {

void add_terrain(const TerrainCfg& cfg, mjSpec* spec) {
  if (cfg.terrain_type != "plane") {
    throw ValueError(
        fmt::format("terrain: unknown terrain_type '{}'; expected plane", cfg.terrain_type));
  }
  mjsBody* body = mjs_addBody(mjs_findBody(spec, "world"), nullptr);
  mjs_setName(body->element, "terrain");
  mjsGeom* geom = mjs_addGeom(body, nullptr);
  mjs_setName(geom->element, "terrain");
  geom->type = mjGEOM_PLANE;
  geom->size[2] = 0.01;
}

std::vector<double> terrain_origins(const TerrainCfg& /*cfg*/, int num_worlds, double env_spacing) {
  // A grid centred on the world's origin, row i div cols along -x, column i mod cols along +y.
  const int rows = (num_worlds + static_cast<int>(std::sqrt(num_worlds)) - 1) /
                   static_cast<int>(std::sqrt(num_worlds));
  const int cols = (num_worlds + rows - 1) / rows;
  std::vector<double> origins(3 * num_worlds);
  for (int i = 0; i < num_worlds; ++i) {
    origins[3 * i] = -(i / cols - (rows - 1) / 2.0) * env_spacing;
    origins[3 * i + 1] = (i % cols - (cols - 1) / 2.0) * env_spacing;
  }
  return origins;
}

}  // namespace mjsense
