// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/testing/example.h"

#include "mjsense/sensors/terrain_height/terrain_height_sensor.h"

namespace mjsense::sensors {

SensorCfgs terrain_height_examples() {
  return {example<TerrainHeightSensorCfg>("height", [](TerrainHeightSensorCfg& c) {
    c.frame = {{"site", "imu", "robot"}};
  })};
}

}  // namespace mjsense::sensors
