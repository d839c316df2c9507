// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/all_sensors.h"

#include <vector>

namespace mjsense {

#define MJSENSE_DECLARE(name) SensorKind name##_kind();
MJSENSE_SENSORS(MJSENSE_DECLARE)
#undef MJSENSE_DECLARE

std::span<const SensorKind> sensor_kinds() {
#define MJSENSE_KIND(name) name##_kind(),
  static const std::vector<SensorKind> kKinds = {MJSENSE_SENSORS(MJSENSE_KIND)};
#undef MJSENSE_KIND
  return kKinds;
}

}  // namespace mjsense
