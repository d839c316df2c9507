// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mjsense_tasks/scenes/generators/generator.h"

namespace mjsense::tasks::scenes {

// A fitted kitchen along the wall at +x. The fronts are at x = 0 and face -x.
//
// body          joint              description
// drawer_0 ..   drawer_0/slide     three or four per unit, two units
// cabinet_0 ..  cabinet_0/hinge    leaf: body cabinet_0/door; below the worktop and on the wall
// oven_0        oven_0/hinge       oven_0/door, hinged at the bottom
//   fridge_0      fridge_0/hinge     fridge_0/door; below it freezer_0, freezer_0/door
//   microwave_0   microwave_0/hinge  microwave_0/door
//
// Each leaf has a geom <thing>/handle. Geoms worktop_0 .. are level surfaces for objects.
Generator kitchen_generator();

}  // namespace mjsense::tasks::scenes
