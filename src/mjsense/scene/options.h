#pragma once
// Simulation options of a scene. Entities' own <option> values are not carried over: one scene, one physics.

#include <array>
#include <string>
#include <vector>

namespace mjsense {

struct OptionsCfg {
  double timestep = 0.002;                   // s
  std::string integrator = "implicitfast";   // Euler RK4 implicit implicitfast
  std::string cone = "pyramidal";            // pyramidal elliptic
  std::string solver = "Newton";             // PGS CG Newton
  std::string jacobian = "auto";             // dense sparse auto
  double impratio = 1.0;
  int iterations = 100;
  double tolerance = 1e-8;
  int ls_iterations = 50;
  double ls_tolerance = 0.01;
  int ccd_iterations = 50;
  std::array<double, 3> gravity{0, 0, -9.81};  // m/s^2
  std::vector<std::string> disableflags, enableflags;  // lower-case names of the XML flags
};

}  // namespace mjsense
