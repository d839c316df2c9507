// SPDX-License-Identifier: Apache-2.0
#pragma once
// Checks of configurations beyond the ranges of their fields (core/fields/fields.h).

#include <string>
#include <string_view>

namespace mjsense {

// Unless `good`, throws ValueError "<place>: <field> is <value>: must be <expected>".
void require(bool good, std::string_view context, std::string_view field, double value,
             std::string_view expected);
// Returns "sensor 'imu'", the prefix of a sensor's error messages. Throws ValueError if `name` is
// empty.
std::string sensor_context(std::string_view name);

}  // namespace mjsense
