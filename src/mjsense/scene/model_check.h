// SPDX-License-Identifier: Apache-2.0
#pragma once
// Checks of compiled models for faults that MuJoCo accepts but that make measurements meaningless.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

namespace mjsense::scene {

// Throws ValueError that names the element if a number of the model is NaN, a position is infinite,
// or the timestep is not positive. Adds to `warnings` what is probably a mistake: a timestep of
// more than 0.1 s.
void check_model(const mjModel* model, std::vector<std::string>& warnings);

}  // namespace mjsense::scene
