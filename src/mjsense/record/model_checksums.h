// SPDX-License-Identifier: Apache-2.0
#pragma once
// Checksums of a compiled model, one for each kind of element ("body", "geom", "mesh" ...), so that
// a recording that is resumed with another model can say what differs.

#include <mujoco/mujoco.h>

#include <map>
#include <string>

namespace mjsense {

// By the part of the arrays' names before the first '_'; "size", "option", "statistic" and "visual"
// are those of the structs. The paths of files are left out: a model may move.
[[nodiscard]] std::map<std::string, std::string> model_checksums(const mjModel& model);

}  // namespace mjsense
