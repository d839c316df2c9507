// SPDX-License-Identifier: Apache-2.0
#pragma once
// MolmoSpaces' layout of an episode: which group of the file a stream stands in, and which sensors
// its readers expect as JSON text.

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "mjsense/core/sensor.h"

namespace mjsense {

// "qpos" -> "obs/agent/qpos", "feet/force" -> "obs/extra/feet/force" ...
std::string place_of(std::string_view stream);

// Groups that every episode has, empty or not.
std::span<const char* const> standard_groups();

// Joint positions and velocities, the actions and what grippers hold are numbers in a suite, and
// one dataset a sensor of JSON rows here: what that dataset says of itself. Empty for any other
// sensor, whose fields are datasets of their own.
std::optional<SensorSpec> text_of(const Sensor& sensor);

}  // namespace mjsense
