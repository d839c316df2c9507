// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/testing/example.h"

#include "mjsense/sensors/builtin/builtin_sensor.h"

namespace mjsense::sensors {

SensorCfgs builtin_examples() {
  return {example<BuiltinSensorCfg>("acc", [](BuiltinSensorCfg& c) {
    c.sensor_type = "accelerometer";
    c.obj = {"site", "imu", "robot"};
  })};
}

}  // namespace mjsense::sensors
