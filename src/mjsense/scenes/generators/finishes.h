// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a house is made of: floor, walls, wood, drawn from its random numbers.

#include <span>

#include "mjsense/core/rng.h"
#include "mjsense/scenes/generators/room_text.h"

namespace mjsense {

// Materials floor, wall, ceiling, skirting, lamp_glass: all that write_shell() needs. Floors are
// planks or tiles.
void write_shell_finishes(RoomText& room, Rng& rng);

// One of the colours, each as likely.
Colour pick(Rng& rng, std::span<const Colour> colours);
// Woods and paints that furniture has.
Colour wood_colour(Rng& rng);
Colour paint_colour(Rng& rng);

}  // namespace mjsense
