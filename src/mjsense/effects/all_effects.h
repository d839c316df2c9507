// SPDX-License-Identifier: Apache-2.0
#pragma once
// All effects as one variant. Python and every reader of fields know the types that are listed here.

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

}  // namespace mjsense
