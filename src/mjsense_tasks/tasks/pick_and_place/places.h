// SPDX-License-Identifier: Apache-2.0
#pragma once
// Points at which an object may be put down: next to another object, or within a receptacle.

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/sensor.h"

namespace mjsense::tasks {

struct PlaceQuery {
  const World& world;
  int object, receptacle;  // bodies
  Quat turn;               // rotation of the object before it is put down
  Rng rng;                 // of the drawn places
};

// Appends points at which the middle of the object's underside may be. Drawn places first: a random side,
// gap and shift along the side. Then those nearest to the body `base`.
void places_beside(PlaceQuery query, int base, std::vector<Vec3>& out);

// Drawn places first: points uniformly distributed over the receptacle at which the object fits.
// Then its middle, points around it, and its rim. `surface`: points of the receptacle in its frame.
void places_within(PlaceQuery query, std::span<const Vec3> surface, std::vector<Vec3>& out);

}  // namespace mjsense::tasks
