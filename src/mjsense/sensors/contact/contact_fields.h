// SPDX-License-Identifier: Apache-2.0
#pragma once
// The fields of a slot: their frames, and their positions in a reading.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/sensors/contact/contact_reading.h"

namespace mjsense::sensors {

// Index of the first value of a field (also normal_force, friction_force) in a ContactReading that
// is read as doubles; -1 for found, which is not in it.
int contact_field_offset(std::string_view field);

inline const double* contact_values(const ContactReading& reading, int offset) {
  return reinterpret_cast<const double*>(&reading) + offset;
}

// Frame of a field's rows. `world_axes`: force and torque are in world axes.
std::string contact_field_frame(std::string_view field, bool world_axes);

}  // namespace mjsense::sensors
