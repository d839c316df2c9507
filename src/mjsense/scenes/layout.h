// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where objects stand at the start of an episode: on level surfaces, in one of the ways in which
// they rest, clear of each other.

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/rng.h"
#include "mjsense/episode/object_shape.h"

namespace mjsense {

struct Area {
  double x0, x1, y0, y1;  // m, world
};

// A level surface.
struct Region {
  Area area, target_area;
  double height;  // m
  bool for_targets = true;
};

struct LayoutCfg {
  double gap = 0.02;         // m, free between two objects
  double target_gap = 0.07;  // m, free around the target: room for an open gripper
  double drop = 0.0003;      // m above the surface
  int attempts = 200;        // places to try for an object, then the one with most room
  int layouts = 20;          // tries of them all, while one stands in another's circle
};

// An object to be placed: its shape, and the ways in which it rests.
struct Resting {
  const ObjectShape* shape;
  std::span<const Quat> rests;
};

// Poses X_WO of `objects` and the regions on which they stand: those that are `wanted` first, in this order and in
// the target areas of regions for targets - the first of them, if any, is the target -, then the others in order; those that
// are not `present` keep what is there. Where what came first leaves one no room, all begin anew; after the last try
// the layout in which they come least into each other. A function of the random numbers alone.
void lay_out(std::span<const Resting> objects, std::span<const int> wanted,
             std::span<const char> present, std::span<const Region> regions, const LayoutCfg& cfg,
             Rng& rng, std::span<Pose> poses, std::span<int> region_of);

}  // namespace mjsense
