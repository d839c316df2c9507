// SPDX-License-Identifier: Apache-2.0
#pragma once
// A table in a furnished room. Its size and position are the same in every house; finishes and
// furniture differ.

#include "mjsense_tasks/scenes/generators/generator.h"

namespace mjsense::tasks::scenes {

Generator table_room_generator();

}  // namespace mjsense::tasks::scenes
