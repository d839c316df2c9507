// SPDX-License-Identifier: Apache-2.0
#pragma once
// A door with a latch, for generated rooms. It stands in the plane x = 0 of the writer's frame, the
// middle of its opening at y = 0, and opens towards +x: pushed from x < 0, pulled from x > 0.

#include "mjsense/core/rng.h"
#include "mjsense/scenes/generators/building.h"

namespace mjsense {

struct HingedDoor {
  double width = 0.9, height = 2.03;  // m, of the leaf
  bool hinge_left = true;             // seen from x < 0
  double handle_height = 1.0;         // m
  double handle_length = 0.125;       // m, of a lever
  double opens = 1.5708;              // rad
  double closer = 0.0;                // N m / rad, towards shut
  double friction = 0.8;              // N m
  double damping = 2.0;               // N m s / rad
  double press = 0.6;                 // rad, of a lever, at which the bolt lets go
};

// Drawn: width, height, side of the hinge, lever, friction.
HingedDoor draw_door(Rng& rng);

// What it needs of the wall, along it.
double opening_width(const HingedDoor& door);
double opening_height(const HingedDoor& door);

// Body `door` with joint `door_hinge`, in it body `door_handle` with joint `door_handle_hinge`: a
// lever on both sides. A bolt that the lever draws back stands behind a strike of the frame, so that
// the door does not move before the lever is pressed by `press`. The hinge turns by a negative
// angle where it is on the right. Materials "door_paint",
// "door_metal", "black" and "skirting".
void write_door(Building& out, const HingedDoor& door, double wall_thickness);

}  // namespace mjsense
