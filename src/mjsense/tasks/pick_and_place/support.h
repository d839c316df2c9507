// SPDX-License-Identifier: Apache-2.0
#pragma once
// Does one body carry another? Contact forces say so; without them, contacts and boxes.

#include "mjsense/core/pose.h"
#include "mjsense/core/sensor.h"

namespace mjsense {

struct WorldBox {
  Vec3 low, high;  // m, world axes
  Vec3 center() const { return 0.5 * (low + high); }
};
// Around all geoms of `body` and of the bodies below it.
WorldBox world_box(const World& world, int body);
// The same, turned by `turn` about its origin.
WorldBox turned_box(const World& world, int body, const Quat& turn);

// N, world axes: the sum of the contact forces that geoms of `carrier` and below exert on `object` and below.
Vec3 contact_force(const World& world, int carrier, int object);

// True if `force` holds a body of this subtree mass up: within 30 degrees of up, and at least half
// of the weight.
bool bears(const World& world, Vec3 force, int object);
// Without forces: a contact of the two below the middle of the object's box whose normal is within 30
// degrees of up; or at least half of the object's box above the carrier's, its underside within
// 1 cm of the carrier's top.
bool seems_to_carry(const World& world, int carrier, int object);
inline bool carries(const World& world, int carrier, int object) {
  return bears(world, contact_force(world, carrier, object), object) ||
         seems_to_carry(world, carrier, object);
}

// Body without a parent (or the world, 0) that bears the object by contact forces; -1: none does.
int bearer(const World& world, int object);

// True if something with the half axes `half` (m, along x and y) that stands with the middle of its underside at
// `middle` has a surface all under it, and that of `carrier`, a body without a parent (or the world, 0): rays down on
// its outline meet nothing else. What is below `object` counts for nothing.
bool is_carried_all_over(const World& world, Vec3 middle, Vec3 half, int carrier, int object);

// m between two boxes seen from above; negative where they overlap.
double gap_from_above(const WorldBox& a, const WorldBox& b);

// True if a geom that touches `body` or one below it is below `other_root`.
bool touched_by(const World& world, int body, int other_root);

}  // namespace mjsense
