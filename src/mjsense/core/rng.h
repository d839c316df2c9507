// SPDX-License-Identifier: Apache-2.0
#pragma once
// Random numbers that are a pure function of (seed, world, stream, step, draw), so they do not
// depend on the number of threads or the order of evaluation. Philox4x32-10: Salmon et al.,
// "Parallel random numbers: as easy as 1, 2, 3", SC 2011.

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string_view>

namespace mjsense {

// Stream of a sensor or an effect: a stable hash (FNV-1a) of its name.
constexpr std::uint32_t stream_of(std::string_view name) {
  std::uint32_t h = 2166136261u;
  for (char c : name) h = (h ^ static_cast<std::uint8_t>(c)) * 16777619u;
  return h;
}

class Rng {
 public:
  // `step` identifies the time (a world's step counter, or its episode number for draws made at
  // reset).
  Rng(std::uint64_t seed, std::uint32_t world, std::uint32_t stream, std::uint64_t step)
      : key_{static_cast<std::uint32_t>(seed) ^ (stream * 0x9E3779B9u),
             static_cast<std::uint32_t>(seed >> 32) ^ stream},
        counter_{0, world, static_cast<std::uint32_t>(step),
                 static_cast<std::uint32_t>(step >> 32)} {}

  std::uint32_t next() {
    if (used_ == 4) refill();
    return block_[used_++];
  }
  std::uint64_t next64() { return (static_cast<std::uint64_t>(next()) << 32) | next(); }

  // Uniform in [0, 1), with 53 random bits.
  double uniform() { return static_cast<double>(next64() >> 11) * 0x1.0p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }

  // Uniform integer in [0, n), n > 0, without modulo bias (Lemire's multiply-shift with rejection).
  std::uint32_t below(std::uint32_t n) {
    std::uint64_t product = static_cast<std::uint64_t>(next()) * n;
    if (static_cast<std::uint32_t>(product) < n) {
      const std::uint32_t threshold = (0u - n) % n;
      while (static_cast<std::uint32_t>(product) < threshold)
        product = static_cast<std::uint64_t>(next()) * n;
    }
    return static_cast<std::uint32_t>(product >> 32);
  }

  // Standard normal (Box-Muller; the second value is used by the next call).
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double r = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    const double angle = 2.0 * std::numbers::pi * uniform();
    spare_ = r * std::sin(angle);
    has_spare_ = true;
    return r * std::cos(angle);
  }

 private:
  void refill() {
    std::array<std::uint32_t, 4> c = counter_;
    std::array<std::uint32_t, 2> k = key_;
    for (int round = 0; round < 10; ++round) {
      const std::uint64_t p0 = 0xD2511F53ull * c[0], p1 = 0xCD9E8D57ull * c[2];
      c = {static_cast<std::uint32_t>(p1 >> 32) ^ c[1] ^ k[0], static_cast<std::uint32_t>(p1),
           static_cast<std::uint32_t>(p0 >> 32) ^ c[3] ^ k[1], static_cast<std::uint32_t>(p0)};
      k[0] += 0x9E3779B9u;
      k[1] += 0xBB67AE85u;
    }
    block_ = c;
    used_ = 0;
    ++counter_[0];
  }

  std::array<std::uint32_t, 2> key_;
  std::array<std::uint32_t, 4> counter_;
  std::array<std::uint32_t, 4> block_{};
  int used_ = 4;
  bool has_spare_ = false;
  double spare_ = 0.0;
};

}  // namespace mjsense
