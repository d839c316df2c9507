// SPDX-License-Identifier: Apache-2.0
#pragma once
// Debug visualisation of MuJoCo's sensors: the frame that a sensor is attached to.

#include <string>

#include "mjsense/core/debug_shapes.h"
#include "mjsense/core/sensor.h"

namespace mjsense::scene {

// Draws the axes of the body, site, geom or camera to which sensor `id` is attached, labelled
// "<name>_x" etc. Throws ValueError if it is attached to an element without a frame.
void draw_sensor_frame(const World& world, int id, const std::string& name, DebugShapes& shapes);

}  // namespace mjsense::scene
