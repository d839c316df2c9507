// SPDX-License-Identifier: Apache-2.0
#pragma once
// A chain of effects on the rows of B worlds, followed by a history. It needs no simulation: an
// EffectSensor has one for each field, and a test or a script can use one directly.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor_spec.h"
#include "mjsense/effects/effect.h"

namespace mjsense::effects {

using Effects = std::vector<std::shared_ptr<const Effect>>;

// Throws ValueError for an effect that is null or that is invalid for every row: "<place>, effect 1
// (dropout): ...".
void validate(const Effects& effects, std::string_view context);

struct EffectChainCfg {
  Effects effects;  // applied in this order
  // Number of last outputs, oldest first; the first output of an episode fills all. 0: no history.
  int history_length = 0;
  bool flatten_history = true;  // [h d] instead of [h, *shape]
};

// Describes row number `tick` of a world, at time tick * tick_s.
struct ChainTick {
  int world = 0;          // index of the row
  std::uint32_t key = 0;  // key of the random numbers
  std::uint64_t seed = 0;
  std::int64_t tick = 0, episode = 1;
};

class EffectChain {
 public:
  // `period`: usual time between rows, s, for noise densities and the lengths of delays. Throws
  // ValueError.
  EffectChain(std::string name, const SensorSpec& input, const EffectChainCfg& cfg, int num_worlds,
              double tick_s, double period);

  const SensorSpec& spec() const { return spec_; }  // of the output
  bool needs_every_step() const { return needs_every_step_; }

  // Starts an episode of this world; the next apply() gets its first row.
  void reset(const ChainTick& tick);
  // `in`: a row of the input. `out`: the output row of the same world, which must not be modified
  // between calls. A repeated call with the same tick replaces the newest row.
  void apply(const ChainTick& tick, std::span<const std::byte> in, std::span<std::byte> out);

 private:
  EffectTime moment_of(const ChainTick& tick) const;

  std::vector<std::unique_ptr<Effect>> effects_;
  SensorSpec spec_;
  DType dtype_;
  int size_, history_ = 0;
  double tick_s_;
  bool needs_every_step_ = false;
  struct WorldState {
    std::int64_t tick = 0;
    bool fresh = true;   // no row since the reset
    bool first = false;  // the row of `tick` is the first since the reset
  };
  std::vector<WorldState> worlds_;
};

}  // namespace mjsense::effects
