// SPDX-License-Identifier: Apache-2.0
#pragma once
// What opens and closes in a model: drawers, doors of cabinets, microwaves, fridges. Found, not
// listed: a limited hinge or slide whose body has something that a hand can pull.

#include <mujoco/mujoco.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense {

// What a hand takes: a bar or knob, in the frame of the joint's body.
struct Handle {
  int geom = -1;
  Vec3 middle;
  Vec3 along;                                // unit, of its longest extent
  double half_along = 0;                     // m
  Vec3 outward;                              // unit, away from what it is fixed to
  double half_across = 0, half_outward = 0;  // m, across both, and along `outward`
};

struct Articulation {
  int joint = -1, body = -1, qpos = -1, dof = -1;
  bool slide = false;
  double low = 0, high = 0;  // range: rad or m
  // The ends: closed is the one nearer to 0.
  double closed = 0, open = 0;
  std::string name;      // full, of its body
  std::string category;  // what counts as the same kind: "drawer"
  std::string text;      // what people call it
  Handle handle;

  double range() const { return high - low; }
  // |q| / range, the measure of open.
  double fraction(double q) const { return (q < 0 ? -q : q) / range(); }
  // The position whose fraction this is, between closed and open.
  double at(double fraction) const;
  // How the body has moved in the world when the joint goes from one position to another, given
  // its axis and anchor in the world.
  Pose motion(double from, double to, Vec3 axis, Vec3 anchor) const;
};

// In the order of the model. Joints of bodies whose names start with `robot_prefix` (unless empty),
// and those with actuators, are left out.
std::vector<Articulation> find_articulations(const mjModel* model, std::string_view robot_prefix);

}  // namespace mjsense
