// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mjsense/scenes/generators/generator.h"

namespace mjsense {

// A floor of four to six furnished rooms, open to each other, with things on their furniture.
Generator floor_generator();

}  // namespace mjsense
