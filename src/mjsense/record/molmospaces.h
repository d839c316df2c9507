// SPDX-License-Identifier: Apache-2.0
#pragma once
// MolmoSpaces' episode layout: the HDF5 group of each stream, and the sensors that its readers
// expect as JSON text.

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "mjsense/core/sensor.h"

namespace mjsense {

// "qpos" -> "obs/agent/qpos", "feet/force" -> "obs/extra/feet/force" ...
std::string path_of(std::string_view stream);

// Groups that exist in every episode, even if they are empty.
std::span<const char* const> standard_groups();

// Spec of the dataset of JSON rows that replaces a sensor's fields, or empty if the fields are
// separate datasets. Joint positions, joint velocities, actions and grasp states are numeric fields
// in a suite, but MolmoSpaces stores each of these sensors as one dataset of JSON text.
std::optional<SensorSpec> text_of(const Sensor& sensor);

}  // namespace mjsense
