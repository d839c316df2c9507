// SPDX-License-Identifier: Apache-2.0
#pragma once
// How much of an image objects would cover, found by rays through some of its pixels, before there
// is an image.

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/rays/ray_scene.h"

namespace mjsense {

struct Lookout {
  Pose camera;        // X_WC: x right, y up, looking along -z
  double fovy = 45;   // degrees
  int width, height;  // pixels
};

// Share in [0, 1] of the pixels that show a geom of each object: bodies and what hangs on them.
// Sees what a camera sees: geoms of groups 0 to 2, opaque, from outside. At most about 16,000
// pixels are looked at, evenly spread. The ray scene must be up to date in this world.
std::vector<double> visible_shares(const RayScene& rays, int world, const Lookout& from,
                                   std::span<const int> bodies);

// Whether a camera stands inside a solid geom that is drawn: it would see out of it, and other cameras cannot.
bool is_inside(const RayScene& rays, int world, const Pose& camera);

}  // namespace mjsense
