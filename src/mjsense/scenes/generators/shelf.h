// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mjsense/scenes/generators/generator.h"

namespace mjsense {

// A bookcase against a wall. Geoms board_0 .. board_N-1, the lowest first: level, objects may stand
// on them; books_*, plant and picture are part of the house.
Generator shelf_generator();

}  // namespace mjsense
