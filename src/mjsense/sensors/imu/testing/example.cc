// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/testing/example.h"

#include "mjsense/sensors/imu/imu_sensor.h"

namespace mjsense::sensors {

SensorCfgs imu_examples() {
  return {example<ImuSensorCfg>("imu", [](ImuSensorCfg& c) {
    c.site = {"site", "imu", "robot"};
    c.preset = "mpu6050";
    c.orientation = true;
  })};
}

}  // namespace mjsense::sensors
