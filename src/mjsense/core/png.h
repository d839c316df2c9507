// SPDX-License-Identifier: Apache-2.0
#pragma once
// Pictures for people: contact sheets, depth previews, failing tests. 8-bit PNG over zlib; the same
// pixels give the same bytes.

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace mjsense {

// `pixels` [height, width, channels], row 0 the top, dense; channels 1 (grey), 3 (RGB) or 4 (RGBA).
// Throws ValueError when the sizes do not agree.
std::vector<std::uint8_t> encode_png(std::span<const std::uint8_t> pixels, int width, int height,
                                     int channels);

// Writes the file whole or not at all. Throws RuntimeError naming the path and the reason.
void write_png(const std::filesystem::path& path, std::span<const std::uint8_t> pixels, int width,
               int height, int channels);

}  // namespace mjsense
