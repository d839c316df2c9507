// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/pipeline.h"

#include <memory>

namespace mjsense {

EffectChainCfg pipeline(const PipelineCfg& cfg) {
  EffectChainCfg chain;
  const auto add = [&](const auto& effect) { chain.effects.push_back(effect.clone()); };
  if (cfg.enable_corruption) {
    if (cfg.noise) add(*cfg.noise);
    if (cfg.bias) add(*cfg.bias);
  }
  if (cfg.clip) add(Clip({cfg.clip->first}, {cfg.clip->second}));
  if (cfg.scale != PerComponent{1.0}) add(Scale(cfg.scale));
  if (cfg.nan_policy != NanPolicy::Action::kDisabled) add(NanPolicy(cfg.nan_policy));
  if (cfg.delay.max_lag > 0) add(cfg.delay);
  chain.history_length = cfg.history_length;
  chain.flatten_history = cfg.flatten_history;
  return chain;
}

}  // namespace mjsense
