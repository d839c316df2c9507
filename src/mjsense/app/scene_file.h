// SPDX-License-Identifier: Apache-2.0
#pragma once
// What commands that measure in an MJCF file share.

#include <string>

#include "mjsense/sim/simulation.h"

namespace mjsense {

// Whether `what` names a model: an MJCF file, or one that the program brings
// ("embedded:robots/quadruped.xml"; who loads it says which there are). Throws ValueError, with what
// was expected, if it is the name of a file and there is none.
bool names_model(const std::string& what, const std::string& expected);
// What was found odd in the scene, on stderr.
void print_warnings(const Scene& scene);
// Throws RuntimeError if a world failed in the last call: a table of a scene that flew apart says
// nothing.
void check_physics(const Simulation& simulation, const std::string& place);

}  // namespace mjsense
