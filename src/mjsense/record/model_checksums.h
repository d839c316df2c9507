// SPDX-License-Identifier: Apache-2.0
#pragma once
// Checksums of a compiled model, one per kind of element ("body", "geom", "mesh" ...), so that the
// error for resuming a recording with another model can say what differs.

#include <mujoco/mujoco.h>

#include <map>
#include <string>

namespace mjsense::record {

// The key of an array is its name up to the first '_'. "size", "option", "statistic" and "visual"
// are the structs of mjModel. File paths are excluded, so that a model may be moved.
[[nodiscard]] std::map<std::string, std::string> model_checksums(const mjModel& model);

}  // namespace mjsense::record
