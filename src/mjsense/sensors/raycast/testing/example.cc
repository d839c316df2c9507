// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/testing/example.h"

#include "mjsense/sensors/raycast/raycast_sensor.h"

namespace mjsense::sensors {

SensorCfgs raycast_examples() {
  return {example<RayCastSensorCfg>("scan", [](RayCastSensorCfg& c) {
    c.frame = {{"body", "trunk", "robot"}};
    c.ray_alignment = "yaw";
  })};
}

}  // namespace mjsense::sensors
