// SPDX-License-Identifier: Apache-2.0
#pragma once
// Builds one tile of a generated terrain.

#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <string_view>

#include "mjsense/core/rng.h"
#include "mjsense/scene/terrain.h"

namespace mjsense::scene {

struct Tile {
  mjSpec* spec;
  mjsBody* body;
  std::string name;              // name of its geoms and of its height field
  std::array<double, 2> centre;  // m
  std::array<double, 2> size;    // m
  double difficulty;             // 0 .. 1
  double resolution;             // m
  Rng rng;
};

// Adds the tile's geoms. Returns the height (m) of the surface at its centre.
double build_tile(const SubTerrainCfg& cfg, Tile& tile);

// A box between the heights `bottom` and `top`. All lengths are in m.
void add_box(mjsBody* body, const std::string& name, std::array<double, 2> centre,
             std::array<double, 2> size, double bottom, double top,
             const std::array<float, 4>& rgba);

}  // namespace mjsense::scene
