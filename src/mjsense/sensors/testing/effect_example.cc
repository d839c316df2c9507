// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/effect_sensor.h"
#include "mjsense/sensors/testing/example.h"

namespace mjsense::sensors {

SensorCfgs effect_examples() {
  return {example<effects::EffectSensorCfg>("noisy", [](effects::EffectSensorCfg& c) {
    c.sensor = "robot/acc";
    c.effects = {std::make_shared<effects::Noise>(effects::Draw::gaussian({0.1})),
                 std::make_shared<effects::Delay>(0.004)};
    c.history_length = 2;
  })};
}

}  // namespace mjsense::sensors
