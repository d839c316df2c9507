// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/physics_options.h"

#include <fmt/format.h>
#include <mujoco/mjxmacro.h>

#include <algorithm>
#include <cctype>
#include <span>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"

namespace mjsense::scene {
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
#define X(type, name, n) \
  if (a.name != b.name) names.emplace_back(#name);
#define XVEC(type, name, n) \
  if (!std::equal(a.name, a.name + (n), b.name)) names.emplace_back(#name);
  MJOPTION_FIELDS
#undef XVEC
#undef X
  return names;
}

}  // namespace mjsense::scene
