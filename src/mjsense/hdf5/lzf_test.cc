// SPDX-License-Identifier: Apache-2.0
#include "mjsense/hdf5/lzf.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

namespace mjsense::hdf5 {
namespace {

// What the bytes unpack to; "refused" if they do not.
std::string unpacked(const std::vector<std::uint8_t>& packed, std::size_t capacity = 16) {
  // Memory before the output must not be read, because it would be copied into the output.
  std::vector<std::uint8_t> memory(16 + capacity, '!');
  const std::size_t n = lzf_unpack(packed, std::span(memory).subspan(16));
  return n == 0 ? "refused"
                : std::string(memory.begin() + 16, memory.begin() + 16 + static_cast<long>(n));
}

TEST(Lzf, RunsAndRepetitions) {
  EXPECT_EQ(unpacked({2, 'a', 'b', 'c'}), "abc");
  EXPECT_EQ(unpacked({0, 'a', 0x20, 0}), "aaaa");            // 3 bytes from 1 before
  EXPECT_EQ(unpacked({1, 'a', 'b', 0x40, 1}), "ababab");     // 4 from 2 before
  EXPECT_EQ(unpacked({0, 'a', 0xe0, 1, 0}), "aaaaaaaaaaa");  // 7 + 1 + 2
}

TEST(Lzf, ReferencesBeforeTheOutputAreRefused) {
  EXPECT_EQ(unpacked({0x20, 0}), "refused");
  EXPECT_EQ(unpacked({0, 'a', 0x20, 1}), "refused");
  EXPECT_EQ(unpacked({1, 'a', 'b', 0x20, 2}), "refused");
  EXPECT_EQ(unpacked({1, 'a', 'b', 0x3f, 0xff}), "refused");
}

TEST(Lzf, TruncatedOrTooLargeDataIsRefused) {
  EXPECT_EQ(unpacked({2, 'a', 'b'}), "refused");
  EXPECT_EQ(unpacked({0, 'a', 0x20}), "refused");
  EXPECT_EQ(unpacked({0, 'a', 0xe0}), "refused");
  EXPECT_EQ(unpacked({0, 'a', 0xe0, 1}), "refused");
  EXPECT_EQ(unpacked({2, 'a', 'b', 'c'}, 2), "refused");
  EXPECT_EQ(unpacked({0, 'a', 0x20, 0}, 4), "aaaa");
  EXPECT_EQ(unpacked({0, 'a', 0x20, 0}, 3), "refused");
}

}  // namespace
}  // namespace mjsense::hdf5
