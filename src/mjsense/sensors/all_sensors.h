// SPDX-License-Identifier: Apache-2.0
#pragma once
// The list of scene sensors. Python, the documentation and the tests for all sensors know the
// sensors in it.

#include <span>

#include "mjsense/core/fields/sensor_fields.h"

namespace mjsense::sensors {

// One line per sensor. Its folder defines `SensorKind <name>_kind()` and, for tests, `SensorCfgs
// <name>_examples()` in testing/example.cc.
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

}  // namespace mjsense::sensors
