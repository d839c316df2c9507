// SPDX-License-Identifier: Apache-2.0
#pragma once
// The random numbers of one path. In each of its dimensions, the numbers of a pixel's samples fill the
// interval or square evenly: they are Sobol's sequence, scrambled and shuffled at random (Owen's
// scrambling, computed with hashes: B. Burley, Practical Hash-based Owen Scrambling, JCGT 2020). Each single
// number is uniform, and those of different dimensions or pixels are independent.

#include <array>
#include <cstdint>

namespace mjsense::render {

class PathRandom {
 public:
  PathRandom() = default;
  PathRandom(std::uint32_t pixel, std::uint32_t sample)
      : pixel_(hash(pixel)), reversed_sample_(reversed(sample)) {}

  // Continues with the first dimension of the path's surface `index`. The numbers of dimensions at a
  // surface may differ from path to path.
  void begin_surface(int index) { dimension_ = 16 * (static_cast<std::uint32_t>(index) + 1); }

  // Uniform in [0, 1).
  double uniform() {
    const std::uint32_t seed = next_seed();
    return first(order(seed), seed);
  }
  std::array<double, 2> square() {
    const std::uint32_t seed = next_seed(), at = order(seed);
    return {first(at, seed), fraction(scrambled(second(at) + hash(seed + 2)))};
  }

 private:
  // A permutation of 32 bits without visible structure (C. Wellons, "hash prospector", lowbias32).
  static std::uint32_t hash(std::uint32_t x) {
    x = (x ^ x >> 16) * 0x7feb352du;
    x = (x ^ x >> 15) * 0x846ca68bu;
    return x ^ x >> 16;
  }
  static std::uint32_t reversed(std::uint32_t x) {
    x = (x & 0x55555555u) << 1 | (x >> 1 & 0x55555555u);
    x = (x & 0x33333333u) << 2 | (x >> 2 & 0x33333333u);
    x = (x & 0x0f0f0f0fu) << 4 | (x >> 4 & 0x0f0f0f0fu);
    return __builtin_bswap32(x);
  }
  // Flips each bit depending on the bits below it. Scrambled numbers are kept with their bits in reverse order,
  // so that these are the bits above it.
  static std::uint32_t scrambled(std::uint32_t x) {
    for (const std::uint32_t factor : {0x6c50b47cu, 0xb82f1e52u, 0xc7afe638u, 0x8d22f6e6u})
      x ^= x * factor;
    return x;
  }
  static double fraction(std::uint32_t x) { return reversed(x) * 0x1p-32; }
  std::uint32_t next_seed() { return hash(pixel_ + dimension_++); }
  // The shuffled number of the sample.
  std::uint32_t order(std::uint32_t seed) const {
    return reversed(scrambled(reversed_sample_ + seed));
  }
  static double first(std::uint32_t at, std::uint32_t seed) {
    return fraction(scrambled(at + hash(seed + 1)));
  }
  // The second dimension of Sobol's sequence, bits reversed: bit j is the sum, modulo 2, of the bits k of the index
  // whose binomial coefficient (k over j) is odd, which are those whose k has all bits of j.
  static std::uint32_t second(std::uint32_t index) {
    index ^= index >> 1 & 0x55555555u;
    index ^= index >> 2 & 0x33333333u;
    index ^= index >> 4 & 0x0f0f0f0fu;
    index ^= index >> 8 & 0x00ff00ffu;
    return index ^ index >> 16;
  }

  std::uint32_t pixel_ = 0, reversed_sample_ = 0, dimension_ = 0;
};

}  // namespace mjsense::render
