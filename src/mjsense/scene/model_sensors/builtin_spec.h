// SPDX-License-Identifier: Apache-2.0
#pragma once
// Unit, frame, bounds and description of a MuJoCo sensor, derived from the compiled model.

#include <mujoco/mujoco.h>

#include "mjsense/core/sensor_spec.h"

namespace mjsense::scene {

SensorSpec describe_builtin(const mjModel* model, int sensor_id);

}  // namespace mjsense::scene
