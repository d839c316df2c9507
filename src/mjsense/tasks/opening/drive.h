// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where a base drives while its arm leads a handle along.

#include <vector>

#include "mjsense/scenes/base_route.h"
#include "mjsense/tasks/opening/articulation.h"

namespace mjsense {

// How an articulation moves in the world.
struct HandleMotion {
  const Articulation* one = nullptr;
  double from = 0, to = 0;  // rad or m, of its joint
  Vec3 axis, anchor;        // world
  // Of what it carries, since the joint was at `from`; `part` of the way, 0 .. 1.
  Pose at(double part) const { return one->motion(from, from + part * (to - from), axis, anchor); }
};

// Along with what moves, and beyond that straight to a place.
struct Drive {
  double share = 0;               // of its motion: 1 is as if the base were a part of it
  double x = 0, y = 0, turn = 0;  // m and rad, world, at the end of the way
};

// `part` of the way (0 .. 1) from where the base stands; the tool is at `tool` (world) at its beginning.
BasePose driven(const BasePose& from, const Drive& drive, const HandleMotion& motion, Vec3 tool,
                double part);

// By rising cost: those first that drive little and leave the arm the posture that it has.
const std::vector<Drive>& drives();

}  // namespace mjsense
