// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/crc32.h"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

namespace mjsense::record {
namespace {

std::vector<std::uint8_t> some_bytes(std::size_t count) {
  std::vector<std::uint8_t> bytes(count);
  std::uint32_t state = 1;
  for (std::uint8_t& b : bytes)
    b = static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 24);
  return bytes;
}

// The check value of CRC-32/ISO-HDLC in the catalogue of parametrised CRC algorithms.
TEST(Crc32, EqualsTheCatalogueValue) {
  const std::string_view digits = "123456789";
  EXPECT_EQ(crc32_of(0, digits.data(), digits.size()), 0xCBF43926);
  EXPECT_EQ(crc32_of(0, nullptr, 0), 0U);
}

std::uint32_t bit_by_bit(std::uint32_t crc, const std::uint8_t* bytes, std::size_t count) {
  crc = ~crc;
  for (std::size_t i = 0; i < count; ++i) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320 : 0);
  }
  return ~crc;
}

std::vector<detail::Crc32> all_variants() {
  std::vector<detail::Crc32> variants = detail::crc32_clmul();
  variants.push_back(detail::crc32_portable);
  return variants;
}

// Every length, alignment and initial value gives the same result as the bitwise algorithm.
TEST(Crc32, EveryLengthAndAlignment) {
  const std::vector<std::uint8_t> bytes = some_bytes(1400);
  for (const std::size_t begin : {0, 1, 7, 15, 33, 63}) {
    for (std::size_t count = 0; begin + count <= bytes.size(); ++count) {
      const auto before = static_cast<std::uint32_t>(count * 2654435761U);
      const std::uint32_t expected = bit_by_bit(before, bytes.data() + begin, count);
      for (const detail::Crc32 variant : all_variants())
        ASSERT_EQ(variant(before, bytes.data() + begin, count), expected) << begin << " " << count;
    }
  }
}

TEST(Crc32, PiecewiseEqualsOneCall) {
  const std::vector<std::uint8_t> bytes = some_bytes(1'000'003);
  const std::uint32_t all = bit_by_bit(0, bytes.data(), bytes.size());
  for (const detail::Crc32 variant : all_variants()) {
    EXPECT_EQ(variant(0, bytes.data(), bytes.size()), all);
    for (std::size_t cut = 0; cut < 1000; cut += 37)
      ASSERT_EQ(variant(variant(0, bytes.data(), cut), bytes.data() + cut, bytes.size() - cut), all)
          << cut;
  }
}

}  // namespace
}  // namespace mjsense::record
