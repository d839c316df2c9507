// SPDX-License-Identifier: Apache-2.0
#pragma once
// All effects as one variant. Only effects in this list are available in Python and in files.

#include <memory>

#include "mjsense/core/fields/field_traits.h"
#include "mjsense/effects/calibration.h"
#include "mjsense/effects/chain.h"
#include "mjsense/effects/noise.h"
#include "mjsense/effects/timing.h"

namespace mjsense::effects {

template <class... E>
struct EffectTypes {};
// To add an effect, add its class here.
using AllEffects = EffectTypes<Noise, EpisodeBias, BiasDrift, Scale, Misalignment, Clip, Quantize,
                               NanPolicy, Delay, StepDelay, Rate, Dropout>;

}  // namespace mjsense::effects

namespace mjsense {
template <>
struct CustomFieldType<std::shared_ptr<const effects::Effect>> {
  static FieldType make();
};
}  // namespace mjsense

namespace mjsense::effects {

// Checks the fields of an effect, also against each other. Throws ValueError; `context` starts its
// message.
void check_effect(const std::shared_ptr<const Effect>& effect, std::string_view context);

}  // namespace mjsense::effects
