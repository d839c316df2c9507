// SPDX-License-Identifier: Apache-2.0
#pragma once
// What MuJoCo compiles without a word and nothing can be measured in.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

namespace mjsense {

// Throws ValueError that names the element for a number of the model that is NaN, a place that is
// infinite, or a timestep that is not positive. Adds to `warnings` what will hardly be meant: a
// timestep of more than 0.1 s.
void check_model(const mjModel* model, std::vector<std::string>& warnings);

}  // namespace mjsense
