// SPDX-License-Identifier: Apache-2.0
#pragma once
// Helpers of the commands that read sensors in an MJCF file.

#include <string>

#include "mjsense/sim/simulation.h"

namespace mjsense::app {

// Whether `what` names a model: an MJCF file, or any name that begins with "embedded:"
// ("embedded:robots/quadruped.xml"; loading it reports the valid names). Throws ValueError, with
// what was expected, if it looks like the name of a file and there is no such file.
bool names_model(const std::string& what, const std::string& expected);
// Prints the scene's warnings on stderr.
void print_warnings(const scene::Scene& scene);
// Throws RuntimeError if a world failed in the last call, because measurements of a diverged
// simulation are meaningless.
void check_physics(const sim::Simulation& simulation, const std::string& context);

}  // namespace mjsense::app
