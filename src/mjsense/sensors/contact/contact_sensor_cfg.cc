// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/config_checks.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/sensor_fields.h"
#include "mjsense/sensors/contact/contact_data.h"
#include "mjsense/sensors/contact/contact_sensor.h"

namespace mjsense::sensors {

std::unique_ptr<Sensor> ContactSensorCfg::build() const {
  const std::string context = sensor_context(name);
  check_fields(*this, context);
  validate_primary(primary, context + ": primary");
  if (secondary) validate_secondary(*secondary, secondary_policy, context + ": secondary");
  if (secondary_policy == ContactPolicy::kEach && !secondary) {
    throw ValueError(fmt::format("{}: secondary_policy 'each' needs a secondary", context));
  }
  const auto asked = [&](std::string_view field) {
    return std::find(fields.begin(), fields.end(), field) != fields.end();
  };
  if (global_frame && reduce != ContactReduce::kNetForce &&
      !(asked("normal") && asked("tangent"))) {
    throw ValueError(
        fmt::format("{}: global_frame needs 'normal' and 'tangent' among fields", context));
  }
  return std::make_unique<ContactSensor>(*this);
}

SensorKind contact_kind() { return sensor_kind<ContactSensorCfg>(&kContactData); }

}  // namespace mjsense::sensors
