// SPDX-License-Identifier: Apache-2.0
#pragma once
// Procedural textures: wood, planks, tiles, stone, plaster, cloth. They are square and tile
// seamlessly. Equal arguments give equal bytes.

#include <array>
#include <cstdint>
#include <string>

namespace mjsense::tasks::scenes {

using Colour = std::array<double, 3>;  // rgb in [0, 1]

Colour mix(Colour a, Colour b, double t);
Colour brighter(Colour c, double factor);

// Return PNG files of `size` x `size` pixels.
std::string wood_png(Colour colour, std::uint32_t seed, int size = 256);  // grain along the rows
// Boards glued side by side, each along a whole row with its own tone.
std::string boards_png(Colour colour, int boards, std::uint32_t seed, int size = 512);
// Planks along the rows; each of the `boards` planks has its own tone.
std::string planks_png(Colour colour, int boards, std::uint32_t seed, int size = 512);
// `count` x `count` tiles with joints; `bricks` shifts every second row by half a tile.
std::string tiles_png(Colour colour, Colour joint, int count, bool bricks, std::uint32_t seed,
                      int size = 512);
std::string stone_png(Colour colour, std::uint32_t seed, int size = 256);
std::string plaster_png(Colour colour, std::uint32_t seed, int size = 256);
std::string cloth_png(Colour colour, std::uint32_t seed, int size = 256);
std::string brushed_png(Colour colour, std::uint32_t seed, int size = 256);  // steel
// A landscape painting: hills under a sky. It does not tile.
std::string landscape_png(std::uint32_t seed, int size = 256);

}  // namespace mjsense::tasks::scenes
