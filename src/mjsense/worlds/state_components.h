// SPDX-License-Identifier: Apache-2.0
#pragma once
// Check of a world's state row for NaN and infinity.

#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#include <string_view>

namespace mjsense::worlds {

// Not one of MuJoCo's warnings: the state that was written contains NaN or infinity.
inline constexpr int kBadState = mjNWARNING;

// Name of the first state component that contains NaN or infinity; "" if there is none.
std::string_view bad_component(mjBatch* batch, int w);

}  // namespace mjsense::worlds
