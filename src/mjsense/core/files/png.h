// SPDX-License-Identifier: Apache-2.0
#pragma once
// PNG encoder for contact sheets, textures, exports and Python. Equal pixels give equal bytes.

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace mjsense {

// `pixels` [height, width, channels], dense, row 0 at the top; 1 (grey), 3 (RGB) or 4 (RGBA)
// channels. `level` is 1 (fastest) to 9 (smallest). `bits` of a channel: 8, or 16 with the high byte
// first. Throws ValueError if the sizes do not agree.
std::vector<std::uint8_t> encode_png(std::span<const std::uint8_t> pixels, int width, int height,
                                     int channels, int level = 6, int bits = 8);

// Writes the file atomically. Throws RuntimeError with the path and the reason.
void write_png(const std::filesystem::path& path, std::span<const std::uint8_t> pixels, int width,
               int height, int channels);

}  // namespace mjsense
