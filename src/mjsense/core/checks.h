// SPDX-License-Identifier: Apache-2.0
#pragma once
// What configurations check beyond the ranges of their fields (core/fields.h).

#include <string>
#include <string_view>

namespace mjsense {

// ValueError "<place>: <field> is <value>: must be <expected>" if not good.
void require(bool good, std::string_view place, std::string_view field, double value,
             std::string_view expected);
// "sensor 'imu'", with which the messages of a sensor begin. Throws if it has no name.
std::string sensor_place(std::string_view name);

}  // namespace mjsense
