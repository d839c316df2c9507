// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/pipeline.h"

#include <string_view>

#include "mjsense/core/fields/fields.h"

namespace mjsense::effects {

EffectChainCfg pipeline(const PipelineCfg& cfg) {
  constexpr std::string_view kPlace = "observation pipeline";
  check_fields(cfg, kPlace);
  EffectChainCfg chain;
  const auto add = [&](const auto& effect) { chain.effects.push_back(effect.clone()); };
  if (cfg.enable_corruption) {
    if (cfg.noise) add(Noise(Draw{*cfg.noise}, cfg.operation));
    if (cfg.bias) add(Noise(Draw::constant(*cfg.bias), cfg.operation));
    if (cfg.episode_bias) add(*cfg.episode_bias);
  }
  if (cfg.clip) add(Clip({(*cfg.clip)[0]}, {(*cfg.clip)[1]}));
  if (cfg.scale != PerComponent{1.0}) add(Scale(cfg.scale));
  if (cfg.nan_policy != NanAction::kDisabled) add(NanPolicy(cfg.nan_policy));
  if (cfg.delay.min_lag > 0 || cfg.delay.max_lag > 0) add(cfg.delay);
  chain.history_length = cfg.history_length;
  chain.flatten_history = cfg.flatten_history;
  validate(chain.effects, kPlace);
  return chain;
}

}  // namespace mjsense::effects
