// SPDX-License-Identifier: Apache-2.0
#pragma once
// The surface of a rigid object as points: what placing and grasping look at.

#include <mujoco/mujoco.h>

#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense {

struct ObjectShape {
  std::vector<Vec3> points;  // on the surface of the geoms that touch, body frame, m
  double low = 0, high = 0;  // least and greatest z of a point
  double radius = 0;         // greatest distance of a point from the body's z axis
  double reach = 0;          // greatest distance of a point from the body's origin
};

// Geoms of `body` and of the bodies below it, which must not move against it, sampled about every
// `spacing` m. Throws ValueError for a body without geoms that touch.
ObjectShape object_shape(const mjModel* model, int body, double spacing = 0.004);

// The same object, `size` times as large.
ObjectShape scaled(const ObjectShape& shape, double size);

}  // namespace mjsense
