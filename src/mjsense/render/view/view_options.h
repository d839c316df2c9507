// SPDX-License-Identifier: Apache-2.0
#pragma once
// What the views of a camera show, for all its images.

#include <cstddef>

#include "mjsense/render/view/physical_light.h"
#include "mjsense/render/view/warp_look.h"

namespace mjsense::render {

struct ViewOptions {
  unsigned groups = 0x7;  // bit g: geoms of group g
  bool textures = true;
  bool shadows = false;
  int shadow_samples = 1;  // lights that are drawn for a light with a radius
  bool reflections = false;
  bool layered = false;  // View::layered
  float near = 0, far = 0;
  std::size_t markers = 0;       // maximum number of markers
  bool disable_culling = false;  // disables culling, for tests
  WarpLook warp;                 // for an Appearance and SurfaceAssets that are made with it, too
  PhysicalOptions physical;
};

}  // namespace mjsense::render
