// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/content_cache.h"

#include <gtest/gtest.h>

#include <array>
#include <memory>

namespace mjsense {
namespace {

ContentKey key_of(int value) { return ContentKey().add(std::span<const int>(&value, 1)); }

TEST(ContentCache, EqualContentIsOneObjectUntilItsLastOwnerReleasesIt) {
  ContentCache<int> cache;
  int made = 0;
  const auto get = [&](int value) {
    return cache.get(key_of(value), [&] { return std::make_shared<int>(++made); });
  };
  const auto first = get(7), other = get(8);
  EXPECT_EQ(first, get(7));
  EXPECT_NE(first, other);
  const std::weak_ptr<const int> released = get(9);
  EXPECT_TRUE(released.expired());
  EXPECT_EQ(*get(9), 4);
}

TEST(ContentCache, TheObjectsUsedLastStayWithoutAnOwner) {
  ContentCache<int> cache(2);
  std::array<std::weak_ptr<const int>, 4> objects;
  const auto use = [&](int i) {
    objects[i] = cache.get(key_of(i), [&] { return std::make_shared<int>(i); });
  };
  for (int i : {0, 1, 2, 1, 3}) use(i);
  EXPECT_TRUE(objects[0].expired() && objects[2].expired());
  EXPECT_FALSE(objects[1].expired() || objects[3].expired());
}

}  // namespace
}  // namespace mjsense
