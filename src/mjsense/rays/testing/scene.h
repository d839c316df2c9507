// SPDX-License-Identifier: Apache-2.0
#pragma once
// Scenes for ray tests: random geoms of every type, compiled by MuJoCo, with one mjData.

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <cmath>
#include <string>

#include "mjsense/core/rng.h"
#include "mjsense/core/testing/test_model.h"

namespace mjsense::testing {

inline std::string vec(std::initializer_list<double> xs) {
  std::string s;
  for (double x : xs) s += std::to_string(x) + " ";
  return s;
}

// MJCF of `count` geoms in a cube of half size `radius` (m) around the origin. The types are taken
// from `types` in turn.
inline std::string random_geoms(Rng& rng, std::initializer_list<const char*> types, int count,
                                double radius) {
  std::string xml;
  int i = 0;
  for (; i < count; ++i) {
    const std::string type = types.begin()[i % types.size()];
    const auto coordinate = [&] { return rng.uniform(-radius, radius); };
    const auto size = [&] { return rng.uniform(0.03, 0.5); };
    std::string attributes;
    if (type == "mesh")
      attributes = rng.below(2) ? "mesh='rock'" : "mesh='tetra'";
    else if (type == "hfield")
      attributes = "hfield='hills'";
    else if (type == "plane")
      attributes = "size='" + vec({rng.below(2) ? 0 : 1.5, rng.below(2) ? 0 : 1.0, 0.1}) + "'";
    else
      attributes = "size='" + vec({size(), size(), size()}) + "'";
    const double tilt = type == "plane" ? 30 : 180;
    xml += "<geom type='" + type + "' " + attributes + " pos='" +
           vec({coordinate(), coordinate(), coordinate()}) + "' euler='" +
           vec({rng.uniform(-tilt, tilt), rng.uniform(-tilt, tilt), rng.uniform(-180, 180)}) +
           "' group='" + std::to_string(rng.below(8)) + "'/>\n";
  }
  return xml;
}

inline std::string random_scene(Rng& rng, std::initializer_list<const char*> types, int count,
                                double radius) {
  std::string rock, hills;
  for (int i = 0; i < 40; ++i)
    rock += vec({rng.uniform(-0.5, 0.5), rng.uniform(-0.3, 0.3), rng.uniform(-0.4, 0.4)});
  for (int i = 0; i < 13 * 9; ++i) hills += vec({rng.below(5) == 0 ? 0.0 : rng.uniform()});
  return "<mujoco><asset><mesh name='rock' vertex='" + rock + "'/>" +
         "<mesh name='tetra' vertex='0 0 0 .6 0 0 0 .5 0 .1 .1 .4'/>" +
         "<hfield name='hills' nrow='13' ncol='9' size='1.2 .9 .4 .1' elevation='" + hills +
         "'/></asset><worldbody>" + random_geoms(rng, types, count, radius) +
         "</worldbody></mujoco>";
}

inline void random_direction(Rng& rng, double d[3]) {
  double n = 0;
  do {
    for (int k = 0; k < 3; ++k) d[k] = rng.normal();
    n = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  } while (n < 1e-6);
  for (int k = 0; k < 3; ++k) d[k] /= n;
}

// Direction from o to a random point of the cube of half size `radius` around the world's origin.
inline void aim(Rng& rng, double radius, const double o[3], double d[3]) {
  for (int k = 0; k < 3; ++k) d[k] = rng.uniform(-radius, radius) - o[k];
  mju_normalize3(d);
}

}  // namespace mjsense::testing
