// SPDX-License-Identifier: Apache-2.0
#pragma once
// A door with a latch. It is in the plane x = 0 of the writer's frame, with the centre of its
// opening at y = 0, and opens towards +x: pushed from x < 0, pulled from x > 0.

#include "mjsense/core/rng.h"
#include "mjsense_tasks/scenes/generators/room_writer.h"

namespace mjsense::tasks::scenes {

struct HingedDoor {
  double width = 0.9, height = 2.03;  // m, of the leaf
  bool hinge_left = true;             // as seen from x < 0
  double handle_height = 1.0;         // m
  double handle_length = 0.125;       // m, of a lever
  double opens = 1.5708;              // rad
  double friction = 0.8;              // N m
  double damping = 2.0;               // N m s / rad
  double press = 0.6;                 // rad, lever angle at which the bolt is withdrawn
};

// Random width, height, hinge side, lever and friction.
HingedDoor draw_door(Rng& rng);

// Size of the opening that the door needs in the wall.
double opening_width(const HingedDoor& door);
double opening_height(const HingedDoor& door);

// Writes body `door` with joint `door_hinge`, and in it body `door_handle` with joint
// `door_handle_hinge`, a lever on both sides. The lever withdraws a bolt, which is blocked by a
// strike of the frame, so that the door does not move until the lever is pressed by `press`. The
// hinge turns by a negative angle if it is on the right. Uses the materials "door_paint",
// "door_metal", "black" and "skirting".
void write_door(RoomWriter& out, const HingedDoor& door);

}  // namespace mjsense::tasks::scenes
