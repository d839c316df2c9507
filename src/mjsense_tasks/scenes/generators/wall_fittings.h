// SPDX-License-Identifier: Apache-2.0
#pragma once
// What is fixed to a wall. The face of the wall is at y = 0 of the writer's frame and looks towards
// -y; the frame's origin is on the floor. None of it collides: it is thin, or cloth.

#include <string_view>

#include "mjsense/core/rng.h"
#include "mjsense_tasks/scenes/generators/room_writer.h"

namespace mjsense::tasks::scenes {

// Painted panels up to 0.95 m with a rail above, from x = `from` to `to`. Uses the materials "panel"
// and "skirting".
void write_panelling(RoomWriter& out, double from, double to);
// A board with pegs at x, one or two coats and a bag. Uses the furniture's materials.
void write_coat_rack(RoomWriter& out, double x, Rng& rng);
void write_light_switch(RoomWriter& out, double x);
void write_wall_clock(RoomWriter& out, double x, Rng& rng);

}  // namespace mjsense::tasks::scenes
