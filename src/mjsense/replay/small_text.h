// SPDX-License-Identifier: Apache-2.0
#pragma once
// Labels in pictures: capital letters of 6 x 10 pixels.

#include <cstdint>
#include <span>
#include <string_view>

namespace mjsense {

// Writes light text into `rgb` [*, width, 3] with its left upper corner at (x, y); what does not
// fit is left out.
void draw_text(std::span<std::uint8_t> rgb, int width, int x, int y, std::string_view text);

}  // namespace mjsense
