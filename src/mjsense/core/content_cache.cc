// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/content_cache.h"

#define XXH_INLINE_ALL  // only the header, no library
#include <xxhash.h>

namespace mjsense {

void ContentKey::add_bytes(std::span<const std::byte> bytes) {
  const XXH128_hash_t of_bytes = XXH3_128bits(bytes.data(), bytes.size());
  const std::uint64_t words[] = {low_, high_, bytes.size(), of_bytes.low64, of_bytes.high64};
  const XXH128_hash_t sum = XXH3_128bits(words, sizeof words);
  low_ = sum.low64;
  high_ = sum.high64;
}

std::uint64_t hash_of(std::span<const std::byte> bytes, std::uint64_t seed) {
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), seed);
}

}  // namespace mjsense
