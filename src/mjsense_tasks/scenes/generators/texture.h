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

// PNG files.
struct Picture {
  std::string colours;
  std::string normals;  // a normal map of half the size, for surfaces with a relief; else empty
};

// Return pictures of `size` x `size` pixels.
Picture wood_picture(Colour colour, std::uint32_t seed, int size = 256);  // grain along the rows
// Boards glued side by side, each along a whole row with its own tone.
Picture boards_picture(Colour colour, int boards, std::uint32_t seed, int size = 512);
// Planks along the rows; each of the `boards` planks has its own tone.
Picture planks_picture(Colour colour, int boards, std::uint32_t seed, int size = 512);
// `count` x `count` tiles with joints; `bricks` shifts every second row by half a tile.
Picture tiles_picture(Colour colour, Colour joint, int count, bool bricks, std::uint32_t seed,
                      int size = 512);
Picture stone_picture(Colour colour, std::uint32_t seed, int size = 256);
Picture plaster_picture(Colour colour, std::uint32_t seed, int size = 256);
Picture cloth_picture(Colour colour, std::uint32_t seed, int size = 256);
Picture brushed_picture(Colour colour, std::uint32_t seed, int size = 256);  // steel
// A landscape painting: hills under a sky. It does not tile.
Picture landscape_picture(std::uint32_t seed, int size = 256);

// What a window shows: hills below a sky, in the light of the time of day.
struct Outdoors {
  Colour sky, horizon, land;
};
Picture outdoors_picture(const Outdoors& look, int size = 64);

}  // namespace mjsense::tasks::scenes
