// SPDX-License-Identifier: Apache-2.0
#pragma once
// MolmoSpaces' episode layout: the HDF5 group of each stream, and the sensors that its readers
// expect as JSON text.

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "mjsense/core/sensor.h"

namespace mjsense::record {

// "qpos" -> "obs/agent/qpos", "feet/force" -> "obs/extra/feet/force" ...
std::string path_of(std::string_view stream);

// Path of a field of a sensor that MolmoSpaces stores as JSON text: the field "arm" of the text at
// "obs/agent/qpos" is "numbers/obs/agent/qpos/arm".
std::string numbers_path(std::string_view text, std::string_view field);

// Groups that exist in every episode, even if they are empty.
std::span<const char* const> standard_groups();

// Spec of the dataset of JSON rows that contains a sensor's fields, or empty if there is none. Joint
// positions, joint velocities, actions and grasp states are numeric fields in a suite, but
// MolmoSpaces stores each of these sensors as one dataset of JSON text. Recordings have both: the
// text for MolmoSpaces' readers, and each field at its numbers_path().
std::optional<SensorSpec> text_of(const Sensor& sensor);

}  // namespace mjsense::record
