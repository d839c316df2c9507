// SPDX-License-Identifier: Apache-2.0
#pragma once
// Walls with openings, and windows, for houses with several rooms.

#include <vector>

#include "mjsense_tasks/scenes/generators/room_writer.h"

namespace mjsense::tasks::scenes {

inline constexpr double kWallHeight = 2.6, kWallThickness = 0.12;  // m

// An opening in a wall: extent along the wall from its start, and heights, m.
struct Opening {
  double from = 0, to = 0;
  double bottom = 0, top = 2.1;
};
// A straight wall on the floor; `from` and `to` are on its centre line. It has a skirting board on
// both sides, except where an opening reaches the floor. The sides of its openings are lined. Uses
// the materials "wall" and "skirting".
void write_wall(RoomWriter& out, Vec3 from, Vec3 to, std::vector<Opening> openings);

// A window in an opening of a wall: frame, bars and a bright pane. `at`: centre of the opening, on
// the floor. The wall runs along the x axis rotated by `yaw`. Uses the materials "window_pane" and
// "skirting".
void write_window(RoomWriter& out, Vec3 at, double yaw, double width, double bottom, double top);

}  // namespace mjsense::tasks::scenes
