// SPDX-License-Identifier: Apache-2.0
#pragma once
// Random placement of objects on level surfaces at the start of an episode, each in one of its
// resting orientations, without collisions.

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/rng.h"
#include "mjsense_tasks/episode/object_shape.h"

namespace mjsense::tasks::scenes {

struct Area {
  double x0, x1, y0, y1;  // m, world frame
};

// A level surface.
struct Region {
  Area area, target_area;
  double height;  // m
  bool for_targets = true;
};

struct LayoutCfg {
  double gap = 0.02;         // m, minimum distance between two objects
  double target_gap = 0.07;  // m, minimum distance around the target, for an open gripper
  double drop = 0.0003;      // m, initial height above the surface
  int attempts = 200;        // positions tried per object; then the one with most clearance is used
  int layouts = 20;          // layouts tried while the circles of two objects overlap
};

// An object to be placed: its shape and its resting orientations.
struct PlacedObject {
  const episode::ObjectShape* shape;
  std::span<const Quat> rests;
};

// Computes the poses X_WO of `objects` and the regions they are placed in. Objects in `wanted` are
// placed first, in this order and in the regions' target areas; the first one, if any, is the
// target. The others follow in order. Objects that are not `present` keep their output values. If
// the objects placed first leave no room for a later one, all are placed again; after the last
// attempt, the layout with the least overlap is used. Deterministic for equal random numbers.
void place_objects(std::span<const PlacedObject> objects, std::span<const int> wanted,
                   std::span<const char> present, std::span<const Region> regions,
                   const LayoutCfg& cfg, Rng& rng, std::span<Pose> poses, std::span<int> region_of);

}  // namespace mjsense::tasks::scenes
