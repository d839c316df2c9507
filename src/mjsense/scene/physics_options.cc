// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/physics_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <span>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/fields.h"

namespace mjsense {
namespace {

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return out;
}

// Parses flags by MuJoCo's XML names in lower case without spaces: "Frictionloss" ->
// "frictionloss", "Clampctrl" -> "clampctrl".
int flags(std::string_view context, std::string_view field, const std::vector<std::string>& wanted,
          std::span<const char* const> known) {
  std::vector<std::string> names;
  for (const char* name : known) {
    std::string flag = lower(name);
    std::erase(flag, ' ');
    names.push_back(std::move(flag));
  }
  int bits = 0;
  for (const std::string& flag : wanted) {
    const auto it = std::find(names.begin(), names.end(), flag);
    if (it == names.end()) {
      throw ValueError(
          fmt::format("{}: {} has no flag '{}'{}", context, field, flag, suggest(flag, names)));
    }
    bits |= 1 << (it - names.begin());
  }
  return bits;
}

}  // namespace

void validate(const OptionsCfg& cfg, std::string_view context) {
  flags(context, "disableflags", cfg.disableflags, {mjDISABLESTRING, mjNDISABLE});
  flags(context, "enableflags", cfg.enableflags, {mjENABLESTRING, mjNENABLE});
}

void apply_options(const OptionsCfg& cfg, mjOption& option) {
  constexpr std::string_view context = "options";
  check_fields(cfg, context);
  option.timestep = cfg.timestep;
  option.integrator = cfg.integrator;
  option.cone = cfg.cone;
  option.solver = cfg.solver;
  option.jacobian = cfg.jacobian;
  option.impratio = cfg.impratio;
  option.iterations = cfg.iterations;
  option.tolerance = cfg.tolerance;
  option.ls_iterations = cfg.ls_iterations;
  option.ls_tolerance = cfg.ls_tolerance;
  option.ccd_iterations = cfg.ccd_iterations;
  std::copy(cfg.gravity.begin(), cfg.gravity.end(), option.gravity);
  std::copy(cfg.magnetic.begin(), cfg.magnetic.end(), option.magnetic);
  std::copy(cfg.wind.begin(), cfg.wind.end(), option.wind);
  option.density = cfg.density;
  option.viscosity = cfg.viscosity;
  option.disableflags =
      flags(context, "disableflags", cfg.disableflags, {mjDISABLESTRING, mjNDISABLE});
  option.enableflags = flags(context, "enableflags", cfg.enableflags, {mjENABLESTRING, mjNENABLE});
}

std::vector<std::string> differing_options(const mjOption& a, const mjOption& b) {
  std::vector<std::string> names;
  const auto note = [&](const char* name, auto& mine, auto& theirs) {
    if (!std::equal(std::begin(mine), std::end(mine), std::begin(theirs))) names.emplace_back(name);
  };
  const auto note_number = [&](const char* name, auto mine, auto theirs) {
    if (mine != theirs) names.emplace_back(name);
  };
  note_number("timestep", a.timestep, b.timestep);
  note_number("integrator", a.integrator, b.integrator);
  note_number("cone", a.cone, b.cone);
  note_number("solver", a.solver, b.solver);
  note_number("jacobian", a.jacobian, b.jacobian);
  note_number("impratio", a.impratio, b.impratio);
  note_number("iterations", a.iterations, b.iterations);
  note_number("tolerance", a.tolerance, b.tolerance);
  note_number("ls_iterations", a.ls_iterations, b.ls_iterations);
  note_number("ls_tolerance", a.ls_tolerance, b.ls_tolerance);
  note_number("noslip_iterations", a.noslip_iterations, b.noslip_iterations);
  note_number("noslip_tolerance", a.noslip_tolerance, b.noslip_tolerance);
  note_number("ccd_iterations", a.ccd_iterations, b.ccd_iterations);
  note_number("ccd_tolerance", a.ccd_tolerance, b.ccd_tolerance);
  note_number("density", a.density, b.density);
  note_number("viscosity", a.viscosity, b.viscosity);
  note_number("disableflags", a.disableflags, b.disableflags);
  note_number("enableflags", a.enableflags, b.enableflags);
  note("gravity", a.gravity, b.gravity);
  note("wind", a.wind, b.wind);
  note("magnetic", a.magnetic, b.magnetic);
  note_number("o_margin", a.o_margin, b.o_margin);
  note("o_solref", a.o_solref, b.o_solref);
  note("o_solimp", a.o_solimp, b.o_solimp);
  note("o_friction", a.o_friction, b.o_friction);
  return names;
}

}  // namespace mjsense
