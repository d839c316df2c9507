// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mjsense/scenes/generators/generator.h"

namespace mjsense {

// A table in a dining room: geom table_top is level, region "table" before the robot; chairs, a rug, a
// picture on the wall.
Generator dining_generator();

}  // namespace mjsense
