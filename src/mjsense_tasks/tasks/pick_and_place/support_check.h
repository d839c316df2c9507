// SPDX-License-Identifier: Apache-2.0
#pragma once
// Tests whether one body supports another, by contact forces or, without forces, by contacts and
// bounding boxes.

#include "mjsense/core/aabb.h"
#include "mjsense/core/sensor.h"

namespace mjsense::tasks {

// Bounding box of all geoms in the subtree of `body`, world frame.
Aabb world_box(const World& world, int body);
// The same after rotating the subtree by `turn` about the origin of `body`.
Aabb turned_box(const World& world, int body, const Quat& turn);

// Sum of the contact forces of the subtree of `carrier` on the subtree of `object`, N, world frame.
Vec3 contact_force(const World& world, int carrier, int object);

// True if `force` supports the subtree of `object`: it is within 30 degrees of up and at least half
// of the subtree's weight.
bool bears(const World& world, Vec3 force, int object);
// Test without forces. True if the two have a contact below the middle of the object's box with a
// normal within 30 degrees of up, or if at least half of the object's box is above the carrier's
// box with its underside within 1 cm of the carrier's top.
bool likely_supports(const World& world, int carrier, int object);
inline bool carries(const World& world, int carrier, int object) {
  return bears(world, contact_force(world, carrier, object), object) ||
         likely_supports(world, carrier, object);
}

// Top-level body (or 0, the world) that supports the object by contact forces; -1 if there is none.
int supporting_body(const World& world, int object);

// True if a box would rest completely on `carrier`, a top-level body (or 0, the world). `middle` is
// the center of the box's underside, `half` its half extents (m, along x and y). Rays cast
// downwards from the outline must hit only `carrier`. The subtree of `object` is ignored.
bool is_supported_over_whole_area(const World& world, Vec3 middle, Vec3 half, int carrier,
                                  int object);

// Horizontal gap between two boxes, m; negative if they overlap.
double gap_from_above(const Aabb& a, const Aabb& b);

// True if a geom in the subtree of `other_root` touches the subtree of `body`.
bool touched_by(const World& world, int body, int other_root);

}  // namespace mjsense::tasks
