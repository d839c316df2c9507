// SPDX-License-Identifier: Apache-2.0
#pragma once
// PNG decoder for tests.

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace mjsense::testing {

inline std::uint32_t png_number(const std::uint8_t* p) {
  return p[0] << 24 | p[1] << 16 | p[2] << 8 | p[3];
}

struct DecodedPng {
  int width = 0, height = 0, channels = 0;
  std::vector<std::uint8_t> pixels;
};

// Decodes 8-bit images that are not interlaced, following the PNG specification (11.2, 12.3).
inline DecodedPng decode_png(std::span<const std::uint8_t> png) {
  constexpr std::uint8_t kSignature[8] = {0x89, 'P', 'N', 'G', 0x0d, 0x0a, 0x1a, 0x0a};
  EXPECT_TRUE(png.size() > 8 && std::equal(kSignature, kSignature + 8, png.begin()));
  DecodedPng out;
  std::vector<std::uint8_t> packed;
  std::string order;
  for (std::size_t at = 8; at + 12 <= png.size();) {
    const std::uint32_t size = png_number(&png[at]);
    const std::string type(png.begin() + at + 4, png.begin() + at + 8);
    const std::uint8_t* body = &png[at] + 8;
    EXPECT_EQ(png_number(body + size), crc32(0, &png[at] + 4, size + 4))
        << type;  // the CRC covers type and body
    order += type + " ";
    if (type == "IHDR") {
      EXPECT_EQ(size, 13u);
      out.width = static_cast<int>(png_number(body));
      out.height = static_cast<int>(png_number(body + 4));
      EXPECT_EQ(body[8], 8);  // bits per sample
      constexpr int kChannels[] = {1, 0, 3, 0,
                                   // indexed by colour type; 0: not supported without a palette
                                   2, 0, 4};
      out.channels = body[9] < 7 ? kChannels[body[9]] : 0;
      // compression: deflate; filters: the standard five; not interlaced
      EXPECT_EQ(body[10] + body[11] + body[12], 0);
    }
    if (type == "IDAT") packed.insert(packed.end(), body, body + size);
    at += 12 + size;
  }
  EXPECT_EQ(order, "IHDR IDAT IEND ");
  const std::size_t stride = static_cast<std::size_t>(out.width) * out.channels;
  std::vector<std::uint8_t> rows((stride + 1) * out.height);
  uLongf size = rows.size();
  EXPECT_EQ(uncompress(rows.data(), &size, packed.data(), packed.size()), Z_OK);
  EXPECT_EQ(size, rows.size());
  out.pixels.assign(stride * out.height, 0);
  for (int y = 0; y < out.height; ++y) {
    const std::uint8_t* row = &rows[y * (stride + 1)];
    std::uint8_t* to = out.pixels.data() + y * stride;
    const auto left = [&](std::size_t i) {
      return i < static_cast<std::size_t>(out.channels) ? 0 : to[i - out.channels];
    };
    for (std::size_t i = 0; i < stride; ++i) {
      const int above = y > 0 ? to[i - stride] : 0;
      const int by_filter[] = {0, left(i), above, (left(i) + above) / 2};
      EXPECT_LT(row[0], 4);
      to[i] = static_cast<std::uint8_t>(row[1 + i] + by_filter[row[0] % 4]);
    }
  }
  return out;
}

}  // namespace mjsense::testing
