// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/sha256.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace mjsense::record {
namespace {

std::string sum_of(const std::string& bytes, std::size_t piece = 1000) {
  Sha256 sum;
  for (std::size_t at = 0; at < bytes.size(); at += piece)
    sum.add(bytes.data() + at, std::min(piece, bytes.size() - at));
  return sum.text();
}

// Values of FIPS 180-4's examples and of Python's hashlib.
TEST(Sha256, GivesKnownSums) {
  EXPECT_EQ(sum_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sum_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sum_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sum_of(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, DoesNotDependOnThePieces) {
  for (const std::size_t size : {55, 56, 63, 64, 65, 119, 120, 128, 1000}) {
    const std::string bytes(size, 'x');
    for (const std::size_t piece : {1, 7, 64, 100}) EXPECT_EQ(sum_of(bytes, piece), sum_of(bytes));
  }
  EXPECT_EQ(archive_name(sum_of("abc")), "model_ba7816bf8f01.zip");
}

}  // namespace
}  // namespace mjsense::record
