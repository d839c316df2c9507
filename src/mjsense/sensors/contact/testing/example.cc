// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/testing/example.h"

#include "mjsense/sensors/contact/contact_sensor.h"

namespace mjsense::sensors {

SensorCfgs contact_examples() {
  return {example<ContactSensorCfg>("touch", [](ContactSensorCfg& c) {
    c.primary = {.mode = "body", .pattern = {".*"}, .entity = "robot"};
    c.fields = {"found", "force", "dist", "pos", "normal"};
    c.num_slots = 2;
    c.track_air_time = c.latch = true;
    c.history_length = 3;
  })};
}

}  // namespace mjsense::sensors
