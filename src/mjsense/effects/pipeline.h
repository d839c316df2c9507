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

namespace mjsense::effects {

struct PipelineCfg {
  bool enable_corruption = true;
  std::optional<Draw::Distribution> noise;
  std::optional<PerComponent> bias;
  NamedEnum<Operation> operation = Operation::kAdd;
  std::optional<EpisodeBias> episode_bias;
  std::optional<std::array<double, 2>> clip;
  PerComponent scale = {1.0};
  NamedEnum<NanAction> nan_policy = NanAction::kDisabled;
  StepDelay delay;
  int history_length = 0;
  bool flatten_history = true;
};
template <class V>
void visit_fields(V& v, PipelineCfg& c) {
  v.object("ObservationPipeline", "mjlab's observation pipeline.");
  v("enable_corruption", c.enable_corruption, "Apply noise and biases.");
  v("noise", c.noise, "Noise, drawn anew for every value.");
  v("bias", c.bias, "Constant bias, applied after the noise.").or_one();
  v("operation", c.operation, "How noise and bias change the value; abs: they replace it.");
  v("episode_bias", c.episode_bias,
    "Bias of the additive-bias noise model, applied after noise and bias.");
  v("clip", c.clip, "Lower and upper limit.").may_be_infinite();
  v("scale", c.scale, "Factor, applied after clip.").or_one().not_empty();
  v("nan_policy", c.nan_policy, "Treatment of NaN and infinite values.");
  v("delay_min_lag", c.delay.min_lag, "Minimum delay in rows.").at_least(0);
  v("delay_max_lag", c.delay.max_lag, "Maximum delay in rows; 0: no delay.").at_least(0);
  v("delay_per_env", c.delay.per_world,
    "Draw a lag for each world. False: all worlds have the same lag.");
  v("delay_hold_prob", c.delay.hold_probability,
    "Probability that a drawn lag is discarded and the previous one is kept.")
      .within(0, 1);
  v("delay_update_period", c.delay.update_period, "Number of rows between draws; 0: every row.")
      .at_least(0);
  v("delay_per_env_phase", c.delay.per_world_phase, "Give each world its own phase for the draws.");
  v("history_length", c.history_length,
    "Number of rows kept, oldest first; the first row of a world fills all of them. 0: no history.")
      .at_least(0);
  v("flatten_history_dim", c.flatten_history, "Return the history as [h d] instead of [h, d].");
}

// Throws ValueError for an invalid configuration.
EffectChainCfg pipeline(const PipelineCfg& cfg);

}  // namespace mjsense::effects
