// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/deflate.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string_view>
#include <vector>

namespace mjsense {
namespace {

std::vector<std::uint8_t> some_bytes(std::size_t count) {
  std::vector<std::uint8_t> bytes(count);
  std::uint32_t state = 1;
  for (std::uint8_t& b : bytes)
    b = static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 28);
  return bytes;
}

// The check value of CRC-32/ISO-HDLC in the catalogue of parametrised CRC algorithms.
TEST(Deflate, CrcEqualsTheCatalogueValue) {
  const std::string_view digits = "123456789";
  EXPECT_EQ(crc32_of(0, digits.data(), digits.size()), 0xCBF43926);
  EXPECT_EQ(crc32_of(0, nullptr, 0), 0U);
  EXPECT_EQ(crc32_of(crc32_of(0, digits.data(), 4), digits.data() + 4, 5), 0xCBF43926);
}

TEST(Deflate, EveryLevelAndSizeIsReadAgain) {
  for (const std::size_t count : {0, 1, 100, 100'000}) {
    const std::vector<std::uint8_t> bytes = some_bytes(count);
    for (int level = 1; level <= 9; ++level) {
      const auto packed = deflated(bytes, level, DeflateFormat::kZlib);
      EXPECT_EQ(inflated(packed, count), bytes) << count << " bytes, level " << level;
    }
  }
}

TEST(Deflate, DamagedAndLongerStreamsAreRefused) {
  const std::vector<std::uint8_t> bytes = some_bytes(1000);
  const auto kept = deflated(bytes, 4, DeflateFormat::kZlib);
  std::vector<std::uint8_t> packed(kept.begin(), kept.end());
  EXPECT_TRUE(inflated(packed, bytes.size() - 1).empty());
  for (const std::size_t cut : {packed.size() - 1, packed.size() / 2, std::size_t{0}})
    EXPECT_TRUE(inflated(std::span(packed).first(cut), bytes.size()).empty()) << cut;
  packed.back() ^= 1;  // the checksum of the stream
  EXPECT_TRUE(inflated(packed, bytes.size()).empty());
}

}  // namespace
}  // namespace mjsense
