// SPDX-License-Identifier: Apache-2.0
#pragma once
// Simulation options of a scene. Entities' own <option> values are not carried over: one scene, one
// physics.

#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/fields.h"

namespace mjsense {

template <>
inline constexpr std::array<std::string_view, 5> kWords<mjtIntegrator>{"euler", "rk4", "implicit",
                                                                       "implicitfast", "discrete"};
template <>
inline constexpr std::array<std::string_view, 2> kWords<mjtCone>{"pyramidal", "elliptic"};
template <>
inline constexpr std::array<std::string_view, 3> kWords<mjtSolver>{"pgs", "cg", "newton"};
template <>
inline constexpr std::array<std::string_view, 3> kWords<mjtJacobian>{"dense", "sparse", "auto"};

struct OptionsCfg {
  double timestep = 0.002;
  Word<mjtIntegrator> integrator = mjINT_IMPLICITFAST;
  Word<mjtCone> cone = mjCONE_PYRAMIDAL;
  Word<mjtSolver> solver = mjSOL_NEWTON;
  Word<mjtJacobian> jacobian = mjJAC_AUTO;
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
  v.object(
      "MujocoCfg",
      "Physics options of a scene. Entities' own ``<option>`` values are not carried over: one "
      "scene, one physics.");
  v("timestep", c.timestep, "Of one substep.").unit("s").positive();
  v("integrator", c.integrator, "How a state becomes the next one.");
  v("cone", c.cone, "Of friction.");
  v("solver", c.solver, "Of the constraints.");
  v("jacobian", c.jacobian, "How the constraints' Jacobian is kept.");
  v("impratio", c.impratio, "Stiffness of friction over that of normal forces.").positive();
  v("iterations", c.iterations, "Of the solver, at most.").at_least(1);
  v("tolerance", c.tolerance, "At which the solver stops.").at_least(0);
  v("ls_iterations", c.ls_iterations, "Of the solver's line search, at most.").at_least(1);
  v("ls_tolerance", c.ls_tolerance, "At which the line search stops.").at_least(0);
  v("ccd_iterations", c.ccd_iterations, "Of convex collision detection, at most.").at_least(1);
  v("gravity", c.gravity, "In the world frame.").unit("m/s^2");
  v("magnetic", c.magnetic, "What magnetometers read, in the world frame.");
  v("wind", c.wind, "Velocity of the medium.").unit("m/s");
  v("density", c.density, "Of the medium.").unit("kg/m^3").at_least(0);
  v("viscosity", c.viscosity, "Of the medium.").unit("Pa s").at_least(0);
  v("disableflags", c.disableflags,
    "Lower-case names of MJCF flags: ``(\"contact\", \"gravity\")``.");
  v("enableflags", c.enableflags, "Likewise, of those that are off.");
}

// Of the flags.
void validate(const OptionsCfg& cfg, std::string_view place);
// Throws ValueError for what check_fields() refuses.
void apply_options(const OptionsCfg& cfg, mjOption& option);

// Names of the fields in which two sets of options differ.
std::vector<std::string> differing_options(const mjOption& a, const mjOption& b);

}  // namespace mjsense
