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
  PathRandom(std::uint32_t pixel, std::uint32_t sample) : pixel_(pixel), sample_(sample) {}

  // Continues with the first dimension of the path's surface `index`. The numbers of dimensions at a
  // surface may differ from path to path.
  void begin_surface(int index) { dimension_ = 16 * (static_cast<std::uint32_t>(index) + 1); }

  // Uniform in [0, 1).
  double uniform() { return square()[0]; }
  std::array<double, 2> square() {
    const std::uint32_t seed = hash(hash(pixel_) + dimension_++);
    const std::uint32_t at = scrambled(sample_, seed);
    return {scrambled(reversed(at), hash(seed + 1)) * 0x1p-32,
            scrambled(second(at), hash(seed + 2)) * 0x1p-32};
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
  // Flips each bit depending on the bits above it.
  static std::uint32_t scrambled(std::uint32_t x, std::uint32_t seed) {
    x = reversed(x) + seed;
    for (const std::uint32_t factor : {0x6c50b47cu, 0xb82f1e52u, 0xc7afe638u, 0x8d22f6e6u})
      x ^= x * factor;
    return reversed(x);
  }
  // The second dimension of Sobol's sequence.
  static std::uint32_t second(std::uint32_t index) {
    std::uint32_t out = 0;
    for (std::uint32_t column = 1u << 31; index; index >>= 1, column ^= column >> 1)
      if (index & 1) out ^= column;
    return out;
  }

  std::uint32_t pixel_ = 0, sample_ = 0, dimension_ = 0;
};

}  // namespace mjsense::render
