// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mjsense_tasks/scenes/generators/generator.h"

namespace mjsense::tasks::scenes {

// A table in a dining room, with chairs, a rug and a picture on the wall. Objects are placed on
// geom table_top, in the region "table" in front of the robot.
Generator dining_generator();

}  // namespace mjsense::tasks::scenes
