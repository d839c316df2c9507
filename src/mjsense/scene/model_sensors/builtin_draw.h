// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a sensor of MuJoCo's shows of itself: the frame it is attached to.

#include <string>

#include "mjsense/core/debug_shapes.h"
#include "mjsense/core/sensor.h"

namespace mjsense {

// The axes of the body, site, geom or camera that sensor `id` of the model is attached to, labelled
// "<name>_x" ...; ValueError if it is attached to something without a frame.
void draw_sensor_frame(const World& world, int id, const std::string& name, DebugShapes& shapes);

}  // namespace mjsense
