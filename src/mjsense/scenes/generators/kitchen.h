// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mjsense/scenes/generators/generator.h"

namespace mjsense {

// A fitted kitchen along the wall at +x; its fronts look to -x and stand at x = 0.
//
//   body          joint              what
//   drawer_0 ..   drawer_0/slide     three or four in a unit, two units
//   cabinet_0 ..  cabinet_0/hinge    its leaf is body cabinet_0/door; below the worktop and on the wall
//   oven_0        oven_0/hinge       oven_0/door, hinged below
//   fridge_0      fridge_0/hinge     fridge_0/door; below it freezer_0, freezer_0/door
//   microwave_0   microwave_0/hinge  microwave_0/door
//
// Each leaf has a geom <thing>/handle. Geoms worktop_0 .. are level, objects may stand on them.
Generator kitchen_generator();

}  // namespace mjsense
