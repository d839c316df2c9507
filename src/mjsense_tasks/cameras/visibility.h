// SPDX-License-Identifier: Apache-2.0
#pragma once
// Estimates how much of an image objects would cover, by rays through some of its pixels, before an
// image is rendered.

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/rays/ray_scene.h"

namespace mjsense::tasks::cameras {

struct CameraView {
  Pose camera;        // X_WC: x right, y up, looking along -z
  double fovy = 45;   // degrees
  int width, height;  // pixels
};

// Share in [0, 1] of the pixels that show each object. An object is a body with all its
// descendants. As in a camera image, geoms are visible only if they are in groups 0 to 2, and only
// from outside; those with alpha 0 are invisible, and all others are treated as opaque. At most
// about 16,000 pixels on a regular grid are sampled. The ray scene must be up to date for this
// world.
std::vector<double> visible_shares(const rays::RayScene& rays, int world, const CameraView& from,
                                   std::span<const int> bodies);

// Whether a camera is inside a visible solid geom. Its image would still show what is outside.
bool is_inside(const rays::RayScene& rays, int world, const Pose& camera);

}  // namespace mjsense::tasks::cameras
