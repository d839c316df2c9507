// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mjsense_tasks/scenes/generators/generator.h"

namespace mjsense::tasks::scenes {

// A floor with four to six furnished rooms, connected by openings, with objects on the furniture.
Generator floor_generator();

}  // namespace mjsense::tasks::scenes
