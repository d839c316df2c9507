// SPDX-License-Identifier: Apache-2.0
#pragma once
// Physics options of a scene. The <option> values of entities are not used, because all entities
// share one simulation.

#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/fields/named_enum.h"

namespace mjsense {
template <>
inline constexpr std::array<std::string_view, 5> kEnumNames<mjtIntegrator>{
    "euler", "rk4", "implicit", "implicitfast", "discrete"};
template <>
inline constexpr std::array<std::string_view, 2> kEnumNames<mjtCone>{"pyramidal", "elliptic"};
template <>
inline constexpr std::array<std::string_view, 3> kEnumNames<mjtSolver>{"pgs", "cg", "newton"};
template <>
inline constexpr std::array<std::string_view, 3> kEnumNames<mjtJacobian>{"dense", "sparse", "auto"};
}  // namespace mjsense

namespace mjsense::scene {

struct OptionsCfg {
  double timestep = 0.002;
  NamedEnum<mjtIntegrator> integrator = mjINT_IMPLICITFAST;
  NamedEnum<mjtCone> cone = mjCONE_PYRAMIDAL;
  NamedEnum<mjtSolver> solver = mjSOL_NEWTON;
  NamedEnum<mjtJacobian> jacobian = mjJAC_AUTO;
  double impratio = 1.0;
  int iterations = 100;
  double tolerance = 1e-8;
  int ls_iterations = 50;
  double ls_tolerance = 0.01;
  int ccd_iterations = 50;
  std::array<double, 3> gravity{0, 0, -9.81};
  std::array<double, 3> magnetic{0, -0.5, 0};
  std::array<double, 3> wind{0, 0, 0};
  double density = 0.0;
  double viscosity = 0.0;
  std::vector<std::string> disableflags, enableflags;
};
template <class V>
void visit_fields(V& v, OptionsCfg& c) {
  v.object("MujocoCfg",
           "Physics options of a scene. The ``<option>`` values of entities are not used, because "
           "a scene has one set of physics options.");
  v("timestep", c.timestep, "Duration of one physics step.").unit("s").positive();
  v("integrator", c.integrator, "Numerical integrator.");
  v("cone", c.cone, "Type of the friction cone.");
  v("solver", c.solver, "Constraint solver.");
  v("jacobian", c.jacobian, "Storage of the constraint Jacobian.");
  v("impratio", c.impratio, "Ratio of frictional to normal constraint impedance.").positive();
  v("iterations", c.iterations, "Maximum number of solver iterations.").at_least(1);
  v("tolerance", c.tolerance, "Termination tolerance of the solver.").at_least(0);
  v("ls_iterations", c.ls_iterations, "Maximum number of line search iterations of the solver.")
      .at_least(1);
  v("ls_tolerance", c.ls_tolerance, "Termination tolerance of the line search.").at_least(0);
  v("ccd_iterations", c.ccd_iterations,
    "Maximum number of iterations of convex collision detection.")
      .at_least(1);
  v("gravity", c.gravity, "Gravitational acceleration in the world frame.").unit("m/s^2");
  v("magnetic", c.magnetic, "Magnetic flux that magnetometers measure, in the world frame.");
  v("wind", c.wind, "Velocity of the medium in the world frame.").unit("m/s");
  v("density", c.density, "Density of the medium.").unit("kg/m^3").at_least(0);
  v("viscosity", c.viscosity, "Viscosity of the medium.").unit("Pa s").at_least(0);
  v("disableflags", c.disableflags,
    "Flags to disable, by their lower-case MJCF names: ``(\"contact\", \"gravity\")``.");
  v("enableflags", c.enableflags,
    "Flags to enable that are off by default, by their lower-case MJCF names.");
}

// Checks the flags.
void validate(const OptionsCfg& cfg, std::string_view context);
// Throws ValueError for values that check_fields() rejects.
void apply_options(const OptionsCfg& cfg, mjOption& option);

// Returns the names of the fields in which two sets of options differ.
std::vector<std::string> differing_options(const mjOption& a, const mjOption& b);

}  // namespace mjsense::scene
