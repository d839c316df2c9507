// SPDX-License-Identifier: Apache-2.0
#pragma once
// Default light, sky and ground texture, so that cameras see colours in any scene.

#include <mujoco/mujoco.h>

#include <array>

namespace mjsense::scene {

using Rgb3 = std::array<double, 3>;
inline constexpr Rgb3 kSkyTop{0.55, 0.67, 0.80}, kSkyBottom{0.86, 0.89, 0.92};

// Replaces the sky, if any, by a gradient from the zenith to the nadir.
void set_sky(mjSpec* spec, const char* name, const Rgb3& top, const Rgb3& bottom);

// Adds what the scene lacks: a sun if there is neither a directional light nor one that is fixed in
// the world, a sky if there is none, and a checker
// texture to a plane "terrain" that has neither a material nor a colour. The names of added
// elements begin with "terrain_".
void add_daylight(mjSpec* spec);

}  // namespace mjsense::scene
