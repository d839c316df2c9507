// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a scene's cameras need to see anything in colour.

#include <mujoco/mujoco.h>

#include <array>

namespace mjsense {

using Rgb3 = std::array<double, 3>;
inline constexpr Rgb3 kSkyTop{0.55, 0.67, 0.80}, kSkyBottom{0.86, 0.89, 0.92};

// A sky from the zenith to the nadir, in the place of whatever sky there is.
void set_sky(mjSpec* spec, const char* name, const Rgb3& top, const Rgb3& bottom);

// Adds what is missing: a sun where there is no lamp, a sky where there is none, and squares to a
// plane "terrain" that has neither a material nor a colour of its own. Their names begin with
// "terrain_".
void add_daylight(mjSpec* spec);

}  // namespace mjsense
