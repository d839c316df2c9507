// SPDX-License-Identifier: Apache-2.0
#pragma once
// Checks that configurations share. Each throws ValueError "<place>: <field> is <value>: must be <expected>".

#include <span>
#include <string>
#include <string_view>

namespace mjsense {

void require(bool good, std::string_view place, std::string_view field, double value,
             std::string_view expected);
void require_finite(double value, std::string_view place, std::string_view field);
void require_finite(std::span<const double> values, std::string_view place, std::string_view field);
void require_positive(double value, std::string_view place, std::string_view field);  // and finite
// 0 or more, and finite.
void require_not_negative(double value, std::string_view place, std::string_view field);
void require_not_negative(std::span<const double> values, std::string_view place,
                          std::string_view field);
void require_probability(double value, std::string_view place, std::string_view field);
void require_color(std::span<const float> rgba, std::string_view place, std::string_view field);
// One of these words; returns which. The message has the nearest, or all of them.
int require_word(std::string_view value, std::span<const std::string_view> words,
                 std::string_view place, std::string_view field);
// "sensor 'imu'", with which the messages of a sensor begin. Throws if it has no name.
std::string sensor_place(std::string_view name);

}  // namespace mjsense
