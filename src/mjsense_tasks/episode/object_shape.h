// SPDX-License-Identifier: Apache-2.0
#pragma once
// The surface of a rigid object as points, for placing and grasping it.

#include <mujoco/mujoco.h>

#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense::tasks::episode {

struct ObjectShape {
  std::vector<Vec3> points;  // on the surface of the collision geoms, body frame, m
  double low = 0, high = 0;  // minimum and maximum z of a point
  double radius = 0;         // maximum distance of a point from the body's z axis
  double reach = 0;          // maximum distance of a point from the body's origin
};

// Samples the collision geoms of `body` and of its descendants about every `spacing` m. The
// descendants must not move relative to the body. Throws ValueError if there is no collision geom.
ObjectShape object_shape(const mjModel* model, int body, double spacing = 0.004);

// The same object, scaled by `size`.
ObjectShape scaled(const ObjectShape& shape, double size);

}  // namespace mjsense::tasks::episode
