// SPDX-License-Identifier: Apache-2.0
#pragma once
// mjlab's observation pipeline as a preset: noise, bias, clip, scale, NaN policy, delay, history,
// in this order.

#include <array>
#include <optional>

#include "mjsense/effects/calibration.h"
#include "mjsense/effects/chain.h"
#include "mjsense/effects/noise.h"
#include "mjsense/effects/timing.h"

namespace mjsense {

struct PipelineCfg {
  bool enable_corruption = true;
  std::optional<Draw::Law> noise;
  std::optional<PerComponent> bias;
  Word<Operation> operation = Operation::kAdd;
  std::optional<EpisodeBias> episode_bias;
  std::optional<std::array<double, 2>> clip;
  PerComponent scale = {1.0};
  Word<NanAction> nan_policy = NanAction::kDisabled;
  StepDelay delay;
  int history_length = 0;
  bool flatten_history = true;
};
template <class V>
void visit_fields(V& v, PipelineCfg& c) {
  v.object("ObservationPipeline", "mjlab's observation pipeline.");
  v("enable_corruption", c.enable_corruption, "False leaves noise and biases out.");
  v("noise", c.noise, "Drawn anew for every value.");
  v("bias", c.bias, "Constant, after the noise.").or_one();
  v("operation", c.operation, "Of noise and bias; abs: they replace the value.");
  v("episode_bias", c.episode_bias, "Of the additive-bias noise model, after noise and bias.");
  v("clip", c.clip, "Low and high.").may_be_infinite();
  v("scale", c.scale, "Factor, after clip.").or_one().not_empty();
  v("nan_policy", c.nan_policy, "What becomes of NaN and infinite values.");
  v("delay_min_lag", c.delay.min_lag, "Rows by which the value is late, at least.").at_least(0);
  v("delay_max_lag", c.delay.max_lag, "At most; 0: no delay.").at_least(0);
  v("delay_per_env", c.delay.per_world, "False: all worlds have the same lag.");
  v("delay_hold_prob", c.delay.hold_probability, "That a drawn lag is not taken.").within(0, 1);
  v("delay_update_period", c.delay.update_period, "Rows between draws; 0: every row.").at_least(0);
  v("delay_per_env_phase", c.delay.per_world_phase, "Worlds draw at rows of their own.");
  v("history_length", c.history_length,
    "Rows kept, oldest first; a world's first row fills all. 0: no history.")
      .at_least(0);
  v("flatten_history_dim", c.flatten_history, "[h d] instead of [h, d].");
}

// Throws ValueError for a wrong configuration.
EffectChainCfg pipeline(const PipelineCfg& cfg);

}  // namespace mjsense
