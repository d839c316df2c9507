// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/scene_file.h"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>

#include "mjsense/core/error.h"
#include "mjsense/core/system/print_stderr.h"

namespace mjsense::app {

bool names_model(const std::string& what, const std::string& expected) {
  if (what.starts_with("embedded:")) return true;
  const std::filesystem::path path = what;
  if (std::filesystem::is_regular_file(path)) return true;
  if (std::filesystem::exists(path))
    throw ValueError(fmt::format("{}: is not a file; expected {}", what, expected));
  if (path.has_extension()) throw ValueError(fmt::format("{}: no such file", what));
  return false;
}

void print_warnings(const scene::Scene& scene) {
  for (const std::string& text : scene.warnings()) print_stderr("mjsense: {}\n", text);
}

void check_physics(const sim::Simulation& simulation, const std::string& context) {
  if (simulation.failures().empty()) return;
  throw RuntimeError(
      fmt::format("{}: the physics failed: {}", context, simulation.failures()[0].message));
}

}  // namespace mjsense::app
