// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/testing/example.h"

#include "mjsense/sensors/lidar/lidar_sensor.h"

namespace mjsense::sensors {

SensorCfgs lidar_examples() {
  return {example<LidarSensorCfg>("lidar", [](LidarSensorCfg& c) {
    c.frame = {{"site", "imu", "robot"}};
    c.scan = SpinningScan{.channels = 4, .samples = 60};
    c.motion_distortion = true;
    c.range_noise_std = 0.01;
    c.dropout = 0.1;
  })};
}

}  // namespace mjsense::sensors
