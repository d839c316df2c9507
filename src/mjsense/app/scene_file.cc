// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/scene_file.h"

#include <fmt/format.h>

#include <cstdio>

#include "mjsense/core/error.h"

namespace mjsense {

void print_warnings(const Scene& scene) {
  for (const std::string& text : scene.warnings()) fmt::print(stderr, "mjsense: {}\n", text);
}

void check_physics(const Simulation& simulation, const std::string& place) {
  if (simulation.failures().empty()) return;
  throw RuntimeError(
      fmt::format("{}: the physics failed: {}", place, simulation.failures()[0].message));
}

}  // namespace mjsense
