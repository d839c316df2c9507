#include "mjsense/scene/options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <span>
#include <utility>

#include "mjsense/core/checks.h"
#include "mjsense/core/error.h"

namespace mjsense {
namespace {

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return out;
}

int word(std::string_view place, std::string_view field, std::string_view value,
         std::span<const std::pair<const char*, int>> known) {
  std::vector<std::string> names;
  for (const auto& [name, number] : known) {
    if (lower(value) == lower(name)) return number;
    names.emplace_back(name);
  }
  throw ValueError(fmt::format("{}: {} = '{}' is not known; expected one of {}", place, field,
                               value, fmt::join(names, ", ")));
}

// MuJoCo's XML names of the flags, lower case without spaces: "Frictionloss" -> "frictionloss",
// "Clampctrl" -> "clampctrl".
int flags(std::string_view place, std::string_view field, const std::vector<std::string>& wanted,
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
          fmt::format("{}: {} has no flag '{}'{}", place, field, flag, suggest(flag, names)));
    }
    bits |= 1 << (it - names.begin());
  }
  return bits;
}

constexpr std::pair<const char*, int> kIntegrators[] = {{"Euler", mjINT_EULER},
                                                        {"RK4", mjINT_RK4},
                                                        {"implicit", mjINT_IMPLICIT},
                                                        {"implicitfast", mjINT_IMPLICITFAST},
                                                        {"discrete", mjINT_DISCRETE}};
constexpr std::pair<const char*, int> kCones[] = {{"pyramidal", mjCONE_PYRAMIDAL},
                                                  {"elliptic", mjCONE_ELLIPTIC}};
constexpr std::pair<const char*, int> kSolvers[] = {
    {"PGS", mjSOL_PGS}, {"CG", mjSOL_CG}, {"Newton", mjSOL_NEWTON}};
constexpr std::pair<const char*, int> kJacobians[] = {
    {"dense", mjJAC_DENSE}, {"sparse", mjJAC_SPARSE}, {"auto", mjJAC_AUTO}};

void apply(const OptionsCfg& cfg, std::string_view place, mjOption& option) {
  require(std::isfinite(cfg.timestep) && cfg.timestep > 0, place, "timestep", cfg.timestep,
          "a positive number of seconds");
  require_positive(cfg.impratio, place, "impratio");
  require_positive(cfg.iterations, place, "iterations");
  require_positive(cfg.ls_iterations, place, "ls_iterations");
  require_positive(cfg.ccd_iterations, place, "ccd_iterations");
  require_not_negative(cfg.tolerance, place, "tolerance");
  require_not_negative(cfg.ls_tolerance, place, "ls_tolerance");
  require_not_negative(cfg.density, place, "density");
  require_not_negative(cfg.viscosity, place, "viscosity");
  require_finite(cfg.gravity, place, "gravity");
  require_finite(cfg.magnetic, place, "magnetic");
  require_finite(cfg.wind, place, "wind");
  option.timestep = cfg.timestep;
  option.integrator = word(place, "integrator", cfg.integrator, kIntegrators);
  option.cone = word(place, "cone", cfg.cone, kCones);
  option.solver = word(place, "solver", cfg.solver, kSolvers);
  option.jacobian = word(place, "jacobian", cfg.jacobian, kJacobians);
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
      flags(place, "disableflags", cfg.disableflags, {mjDISABLESTRING, mjNDISABLE});
  option.enableflags = flags(place, "enableflags", cfg.enableflags, {mjENABLESTRING, mjNENABLE});
}

}  // namespace

void validate(const OptionsCfg& cfg, std::string_view place) {
  mjOption option;
  mj_defaultOption(&option);
  apply(cfg, place, option);
}

void apply_options(const OptionsCfg& cfg, mjOption& option) { apply(cfg, "options", option); }

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
