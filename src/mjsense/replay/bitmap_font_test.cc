// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/bitmap_font.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

namespace mjsense::replay {
namespace {

// Renders one character as text: one # or space per pixel of the glyph.
std::string drawn(char c) {
  constexpr int kPixel = 2;
  std::vector<std::uint8_t> rgb(3 * kTextAdvance * kTextHeight, 0);
  draw_text(rgb, kTextAdvance, 0, 0, std::string_view(&c, 1));
  std::string rows;
  for (int y = 0; y < kTextHeight; y += kPixel) {
    for (int x = 0; x < kTextAdvance; x += kPixel)
      rows += rgb[3 * (y * kTextAdvance + x)] > 0 ? '#' : ' ';
    rows += '\n';
  }
  return rows;
}

TEST(SmallText, GlyphsHaveTheExpectedPixels) {
  EXPECT_EQ(drawn('p'),
            "      \n"
            "      \n"
            "####  \n"
            "#   # \n"
            "#   # \n"
            "#   # \n"
            "####  \n"
            "#     \n"
            "#     \n");
  EXPECT_EQ(drawn('0'),
            " ###  \n"
            "#   # \n"
            "#  ## \n"
            "# # # \n"
            "##  # \n"
            "#   # \n"
            " ###  \n"
            "      \n"
            "      \n");
}

// If letters and digits looked alike, names of episodes and cameras would be ambiguous.
TEST(SmallText, EveryCharacterIsDistinct) {
  std::set<std::string> seen;
  for (char c = ' '; c <= '~'; ++c) {
    EXPECT_TRUE(seen.insert(drawn(c)).second) << "'" << c << "' looks like another\n" << drawn(c);
  }
  EXPECT_TRUE(seen.insert(drawn('\x07')).second) << "characters without a glyph are drawn as a box";
  EXPECT_EQ(drawn('\xc3'), drawn('\x07'));
}

TEST(SmallText, TextIsClipped) {
  const int width = 30, height = 20;
  std::vector<std::uint8_t> rgb(3 * width * height, 7);
  draw_text(rgb, width, 8, 5, "WWWW");
  const auto at = [&](int x, int y) { return rgb[3 * (y * width + x)]; };
  EXPECT_EQ(at(8, 5), 225);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < 8; ++x) EXPECT_EQ(at(x, y), 7) << "wrapped into the next row";
  EXPECT_EQ(label_width("WWWW"), 48);
}

}  // namespace
}  // namespace mjsense::replay
