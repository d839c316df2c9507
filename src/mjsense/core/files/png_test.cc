// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/png.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/png.h"

namespace mjsense {
namespace {

TEST(Png, DecodesToTheSamePixels) {
  for (const int channels : {1, 3, 4}) {
    const int width = 7, height = 5;
    std::vector<std::uint8_t> pixels(width * height * channels);
    for (std::size_t i = 0; i < pixels.size(); ++i)
      pixels[i] = static_cast<std::uint8_t>(i * i * 31 + 7);
    const testing::DecodedPng back =
        testing::decode_png(encode_png(pixels, width, height, channels));
    EXPECT_EQ(back.width, width);
    EXPECT_EQ(back.height, height);
    EXPECT_EQ(back.channels, channels);
    EXPECT_EQ(back.pixels, pixels);
  }
}

TEST(Png, SixteenBitsHaveTheHighByteFirst) {
  const std::vector<std::uint8_t> pixels{0x12, 0x34, 0x56, 0x78};  // 1 x 2
  const auto png = encode_png(pixels, 1, 2, 1, 6, 16);
  EXPECT_EQ(png[24], 16);
  std::vector<std::uint8_t> rows(6);
  uLongf size = rows.size();
  ASSERT_EQ(uncompress(rows.data(), &size, &png[41], testing::png_number(&png[33])), Z_OK);
  EXPECT_EQ(rows, (std::vector<std::uint8_t>{0, 0x12, 0x34, 2, 0x44, 0x44}));
}

TEST(Png, ReadsBackPixelByPixel) {
  const int width = 5, height = 3;
  std::vector<std::uint8_t> pixels(width * height * 3);
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(i * 37);
  const auto png = encode_png(pixels, width, height, 3);
  EXPECT_EQ(testing::png_number(&png[16]), 5u);
  EXPECT_EQ(testing::png_number(&png[20]), 3u);
  const std::size_t idat = 8 + 12 + 13;
  ASSERT_EQ(std::string(png.begin() + idat + 4, png.begin() + idat + 8), "IDAT");
  std::vector<std::uint8_t> rows((width * 3 + 1) * height);
  uLongf size = rows.size();
  ASSERT_EQ(uncompress(rows.data(), &size, &png[idat + 8], testing::png_number(&png[idat])), Z_OK);
  ASSERT_EQ(size, rows.size());
  for (int y = 0; y < height; ++y) {
    for (int i = 0; i < width * 3; ++i) {
      std::uint8_t got = rows[y * (width * 3 + 1) + 1 + i];
      if (y > 0) got += pixels[(y - 1) * width * 3 + i];
      EXPECT_EQ(got, pixels[y * width * 3 + i]);
    }
  }
}

TEST(Png, RejectsWrongSizesAndPaths) {
  const std::vector<std::uint8_t> pixels(12);
  EXPECT_THROW(encode_png(pixels, 2, 2, 4), ValueError);
  EXPECT_THROW(encode_png(pixels, 0, 2, 3), ValueError);
  EXPECT_THROW(encode_png(pixels, 3, 2, 2), ValueError);
  EXPECT_THROW(encode_png(pixels, 2, 2, 3, 6, 12), ValueError);
  EXPECT_THROW(write_png("/nonexistent_directory/x.png", pixels, 2, 2, 3), RuntimeError);
}

}  // namespace
}  // namespace mjsense
