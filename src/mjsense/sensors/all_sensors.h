// SPDX-License-Identifier: Apache-2.0
#pragma once
// The sensors there are. What stands here is known to Python, to the documentation, and to the
// tests that hold for every sensor.

#include <span>

#include "mjsense/core/sensor_fields.h"

namespace mjsense {

// One line a sensor: its folder defines `SensorKind <name>_kind()`, and for tests
// `SensorCfgs <name>_examples()` in testing/example.cc.
#define MJSENSE_SENSORS(SENSOR) \
  SENSOR(builtin)               \
  SENSOR(camera)                \
  SENSOR(contact)               \
  SENSOR(effect)                \
  SENSOR(imu)                   \
  SENSOR(lidar)                 \
  SENSOR(raycast)               \
  SENSOR(terrain_height)

std::span<const SensorKind> sensor_kinds();

}  // namespace mjsense
