#pragma once
// Simulation options of a scene. Entities' own <option> values are not carried over: one scene, one
// physics.

#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

struct OptionsCfg {
  double timestep = 0.002;                  // s
  std::string integrator = "implicitfast";  // Euler RK4 implicit implicitfast discrete; case does
                                            // not matter, here and below
  std::string cone = "pyramidal";           // pyramidal elliptic
  std::string solver = "Newton";            // PGS CG Newton
  std::string jacobian = "auto";            // dense sparse auto
  double impratio = 1.0;
  int iterations = 100;
  double tolerance = 1e-8;
  int ls_iterations = 50;
  double ls_tolerance = 0.01;
  int ccd_iterations = 50;
  std::array<double, 3> gravity{0, 0, -9.81};          // m/s^2
  std::array<double, 3> magnetic{0, -0.5, 0};          // magnetometers read it in their frame
  std::array<double, 3> wind{0, 0, 0};                 // m/s
  double density = 0.0;                                // kg/m^3
  double viscosity = 0.0;                              // Pa s
  std::vector<std::string> disableflags, enableflags;  // lower-case names of the XML flags
};

// Throws ValueError for a value out of range or an unknown word, with the known ones.
void validate(const OptionsCfg& cfg, std::string_view place);
// Validates.
void apply_options(const OptionsCfg& cfg, mjOption& option);

// Names of the fields in which two sets of options differ.
std::vector<std::string> differing_options(const mjOption& a, const mjOption& b);

}  // namespace mjsense
