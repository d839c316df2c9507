// SPDX-License-Identifier: Apache-2.0
#pragma once
// Effects one after the other on the rows of B worlds, then history. Needs no simulation: an
// EffectSensor drives one for each field, a test or a script may drive one by hand.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/spec.h"
#include "mjsense/effects/effect.h"

namespace mjsense {

using Effects = std::vector<std::shared_ptr<const Effect>>;

// Throws ValueError for an effect that is null or wrong whatever row it meets: "<place>, effect 1
// (dropout): ...".
void validate(const Effects& effects, std::string_view place);

struct EffectChainCfg {
  Effects effects;  // applied in this order
  int history_length =
      0;  // h last outputs, oldest first; the first of an episode fills all. 0: none
  bool flatten_history = true;  // [h d], else [h, *shape]
};

// Row number `tick` of a world, at time tick * tick_s.
struct ChainTick {
  int world = 0;          // row
  std::uint32_t key = 0;  // whose random numbers these are
  std::uint64_t seed = 0;
  std::int64_t tick = 0, episode = 1;
};

class EffectChain {
 public:
  // period: s between rows as they usually come (noise densities, lengths of delays). Throws
  // ValueError.
  EffectChain(std::string name, const SensorSpec& input, const EffectChainCfg& cfg, int num_worlds,
              double tick_s, double period);

  const SensorSpec& spec() const { return spec_; }  // of the output
  bool eager() const { return eager_; }

  // A new episode of this world; the next apply() is its first row.
  void reset(const ChainTick& tick);
  // in: a row of the input; out: the row of the output of the same world, left alone in between.
  // The same tick again measures the newest row again.
  void apply(const ChainTick& tick, std::span<const std::byte> in, std::span<std::byte> out);

 private:
  EffectMoment moment_of(const ChainTick& tick) const;

  std::vector<std::unique_ptr<Effect>> effects_;
  SensorSpec spec_;
  DType dtype_;
  int size_, history_ = 0;
  double tick_s_;
  bool eager_ = false;
  struct WorldState {
    std::int64_t tick = 0;
    bool fresh = true;   // no row since the reset
    bool first = false;  // the row of `tick` is the first since the reset
  };
  std::vector<WorldState> worlds_;
};

}  // namespace mjsense
