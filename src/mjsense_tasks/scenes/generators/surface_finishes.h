// SPDX-License-Identifier: Apache-2.0
#pragma once
// Random finishes of a house: materials of floor, walls and wood.

#include <span>

#include "mjsense/core/rng.h"
#include "mjsense_tasks/scenes/generators/room_writer.h"

namespace mjsense::tasks::scenes {

// Writes the materials floor, wall, ceiling, skirting, lamp_glass and window_pane, which
// write_shell() needs.
// Floors are planks or tiles.
void write_shell_finishes(RoomWriter& room, Rng& rng);

// Draws one of the colours uniformly.
Colour pick(Rng& rng, std::span<const Colour> colours);
// Draws a colour of wood or paint for furniture.
Colour wood_colour(Rng& rng);
Colour paint_colour(Rng& rng);

}  // namespace mjsense::tasks::scenes
