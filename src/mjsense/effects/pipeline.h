// SPDX-License-Identifier: Apache-2.0
#pragma once
// mjlab's observation pipeline as a preset: noise, clip, scale, NaN policy, delay, history, in this
// order.

#include <optional>
#include <utility>

#include "mjsense/effects/calibration.h"
#include "mjsense/effects/chain.h"
#include "mjsense/effects/noise.h"
#include "mjsense/effects/timing.h"

namespace mjsense {

struct PipelineCfg {
  bool enable_corruption = true;    // of the group: false leaves noise and bias out
  std::optional<Noise> noise;       // add, scale or abs
  std::optional<EpisodeBias> bias;  // of the additive-bias noise model, after the noise
  std::optional<std::pair<double, double>> clip;
  PerComponent scale = {1.0};
  NanPolicy::Action nan_policy = NanPolicy::Action::kDisabled;
  StepDelay delay;  // in rows; max_lag = 0: none
  int history_length = 0;
  bool flatten_history = true;
};

EffectChainCfg pipeline(const PipelineCfg& cfg);

}  // namespace mjsense
