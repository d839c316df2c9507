// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/all_sensors.h"

#include <vector>

#include "mjsense/effects/effect_sensor.h"

namespace mjsense::sensors {

// Defined here because effects/ precedes sensors/ in the order of rooms.
SensorKind effect_kind() { return sensor_kind<effects::EffectSensorCfg>(); }

#define MJSENSE_DECLARE(name) SensorKind name##_kind();
MJSENSE_SENSORS(MJSENSE_DECLARE)
#undef MJSENSE_DECLARE

std::span<const SensorKind> sensor_kinds() {
#define MJSENSE_KIND(name) name##_kind(),
  static const std::vector<SensorKind> kKinds = {MJSENSE_SENSORS(MJSENSE_KIND)};
#undef MJSENSE_KIND
  return kKinds;
}

}  // namespace mjsense::sensors
