// SPDX-License-Identifier: Apache-2.0
#pragma once
// Bitmap font for labels in images: ASCII characters of 10 x 14 pixels plus 4 pixels below the
// baseline.

#include <cstdint>
#include <span>
#include <string_view>

namespace mjsense::replay {

inline constexpr int kTextHeight = 18, kTextAdvance = 12;  // pixels

inline int label_width(std::string_view text) {
  return static_cast<int>(text.size()) * kTextAdvance;
}

// Draws light text into `rgb` [*, width, 3] with its upper left corner at (x, y). Pixels outside of
// the image are clipped.
void draw_text(std::span<std::uint8_t> rgb, int width, int x, int y, std::string_view text);

}  // namespace mjsense::replay
