// SPDX-License-Identifier: Apache-2.0
#pragma once
// Labels in pictures: ASCII letters 10 x 14 pixels large, 4 more below the line.

#include <cstdint>
#include <span>
#include <string_view>

namespace mjsense {

inline constexpr int kTextHeight = 18, kTextAdvance = 12;  // pixels

inline int label_width(std::string_view text) {
  return static_cast<int>(text.size()) * kTextAdvance;
}

// Writes light text into `rgb` [*, width, 3] with its left upper corner at (x, y); what does not
// fit is left out.
void draw_text(std::span<std::uint8_t> rgb, int width, int x, int y, std::string_view text);

}  // namespace mjsense
