// SPDX-License-Identifier: Apache-2.0
#pragma once
// The effects there are, as one choice: what stands here is known to Python and to every reader of
// fields.

#include <memory>

#include "mjsense/effects/calibration.h"
#include "mjsense/effects/chain.h"
#include "mjsense/effects/noise.h"
#include "mjsense/effects/timing.h"

namespace mjsense {

template <class... E>
struct EffectTypes {};
// One word an effect.
using AllEffects = EffectTypes<Noise, EpisodeBias, BiasDrift, Scale, Misalignment, Clip, Quantize,
                               NanPolicy, Delay, StepDelay, Rate, Dropout>;

template <>
struct CustomFieldType<std::shared_ptr<const Effect>> {
  static FieldType make();
};

// Its fields, and what they say of each other. ValueError.
void check_effect(const std::shared_ptr<const Effect>& effect, std::string_view place);

template <class V>
void visit_fields(V& v, EffectChainCfg& c) {
  v.object("EffectChainCfg", "Effects one after the other, then history.");
  v("effects", c.effects, "In this order; each may be limited to some fields.");
  v("history_length", c.history_length,
    "Rows of every field, oldest first; the first of an episode fills all. 0: no history.")
      .at_least(0);
  v("flatten_history", c.flatten_history, "[h d] instead of [h, *shape].");
}

}  // namespace mjsense
