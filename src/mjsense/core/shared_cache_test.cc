// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/shared_cache.h"

#include <gtest/gtest.h>

namespace mjsense {
namespace {

TEST(SharedCache, IsCreatedOnceAndReleasedWithItsLastOwner) {
  SharedCache shared;
  int made = 0;
  const auto get = [&](const char* key) {
    return shared.get<int>(key, [&] { return std::make_shared<const int>(++made); });
  };
  auto a = get("a");
  EXPECT_EQ(get("a"), a);
  EXPECT_EQ(*get("b"), 2);
  a.reset();
  EXPECT_EQ(*get("a"), 3);
}

}  // namespace
}  // namespace mjsense
