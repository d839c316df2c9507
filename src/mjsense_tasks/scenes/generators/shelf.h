// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mjsense_tasks/scenes/generators/generator.h"

namespace mjsense::tasks::scenes {

// A bookcase at a wall. Geoms board_0 .. board_N-1, from the lowest to the highest, are level
// surfaces for objects. books_*, plant and picture belong to the house.
Generator shelf_generator();

}  // namespace mjsense::tasks::scenes
