// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "mjsense_tasks/scenes/generators/room_writer.h"

namespace mjsense::tasks::scenes {

// Shell of a room: floor, ceiling, skirting boards, walls, a lamp below the ceiling, a window.
struct ShellCfg {
  double x0 = -2, x1 = 2, y0 = -2, y1 = 2, height = 2.6;  // m, inner dimensions
  // A window in the wall at y1: its centre along x, sill height, width and height (m).
  double window_x = 0, sill = 1.0, window_wide = 1.2, window_high = 1.1;
};
// Uses the materials of write_shell_finishes(). Names of the geoms: floor, ceiling, wall_x0,
// wall_x1, wall_y0, wall_y1; of the lights: lamp, daylight, bounce, surroundings.
void write_shell(RoomWriter& room, const ShellCfg& shell);
// The light that walls, floor and ceiling reflect to each other, which moods can colour: `bounce` is
// the ambient light of classic images, and the image light `surroundings` that of physically based ones.
void write_bounce_light(RoomWriter& room);

}  // namespace mjsense::tasks::scenes
