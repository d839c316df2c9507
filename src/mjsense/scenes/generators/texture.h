// SPDX-License-Identifier: Apache-2.0
#pragma once
// Pictures of surfaces, made of noise: wood, planks, tiles, stone, plaster, cloth. Square, and each
// edge continues at the opposite one. The same arguments give the same bytes.

#include <array>
#include <cstdint>
#include <string>

namespace mjsense {

using Colour = std::array<double, 3>;  // rgb in [0, 1]

Colour mix(Colour a, Colour b, double t);
Colour brighter(Colour c, double factor);

// Files of PNG, `size` pixels wide and high.
std::string wood_png(Colour colour, std::uint32_t seed, int size = 256);  // grain along the rows
// Boards along the rows, `boards` of them, each with a tone of its own.
std::string planks_png(Colour colour, int boards, std::uint32_t seed, int size = 512);
// `count` x `count` tiles with joints between; every second row moved by half a tile for bricks.
std::string tiles_png(Colour colour, Colour joint, int count, bool bricks, std::uint32_t seed,
                      int size = 512);
std::string stone_png(Colour colour, std::uint32_t seed, int size = 256);
std::string plaster_png(Colour colour, std::uint32_t seed, int size = 256);
std::string cloth_png(Colour colour, std::uint32_t seed, int size = 256);
std::string brushed_png(Colour colour, std::uint32_t seed, int size = 256);  // steel
// Something to hang on a wall: hills under a sky. Its edges do not continue.
std::string landscape_png(std::uint32_t seed, int size = 256);

}  // namespace mjsense
