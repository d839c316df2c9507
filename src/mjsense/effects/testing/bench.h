// SPDX-License-Identifier: Apache-2.0
#pragma once
// For tests of effects: applies them to rows that the test supplies.

#include <memory>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "mjsense/effects/chain.h"

namespace mjsense::effects {

inline constexpr double kPeriod = 0.01;  // s

// An effect chain on rows of floats, which the test supplies.
class Bench {
 public:
  Bench(const EffectChainCfg& cfg, int size, int num_worlds = 1, std::uint64_t seed = 1)
      : seed_(seed),
        chain_("test", spec(size), cfg, num_worlds, kPeriod, kPeriod),
        out_(chain_.spec().shape.size() * num_worlds) {}
  Bench(Effects effects, int size, int num_worlds = 1, std::uint64_t seed = 1)
      : Bench(EffectChainCfg{std::move(effects)}, size, num_worlds, seed) {}

  std::vector<float> feed_row(std::vector<float> row, std::int64_t tick, int world = 0) {
    const std::size_t n = out_.size() / num_worlds();
    float* out = out_.data() + world * n;
    chain_.apply(at(tick, world), std::as_bytes(std::span(row)),
                 std::as_writable_bytes(std::span(out, n)));
    return {out, out + n};
  }
  float feed(float x, std::int64_t tick, int world = 0) { return feed_row({x}, tick, world)[0]; }
  void reset(std::int64_t tick, std::int64_t episode, int world = 0) {
    episode_ = episode;
    chain_.reset(at(tick, world));
  }
  EffectChain& chain() { return chain_; }

 private:
  static SensorSpec spec(int size) {
    SensorSpec s;
    s.shape = {size};
    return s;
  }
  int num_worlds() const { return static_cast<int>(out_.size() / chain_.spec().shape.size()); }
  ChainTick at(std::int64_t tick, int world) const {
    return {world, static_cast<std::uint32_t>(world), seed_, tick, episode_};
  }
  std::uint64_t seed_;
  std::int64_t episode_ = 1;
  EffectChain chain_;
  std::vector<float> out_;
};

template <class E>
Effects one(E effect) {
  return {std::make_shared<E>(std::move(effect))};
}

struct Moments {
  double mean, variance;
};
inline Moments moments(const std::vector<double>& x) {
  const double mean = std::accumulate(x.begin(), x.end(), 0.0) / x.size();
  double sum = 0;
  for (double v : x) sum += (v - mean) * (v - mean);
  return {mean, sum / (x.size() - 1)};
}

}  // namespace mjsense::effects
