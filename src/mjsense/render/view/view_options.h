// SPDX-License-Identifier: Apache-2.0
#pragma once
// What the views of a camera show, for all its images.

#include <cstddef>

#include "mjsense/render/view/physical_light.h"

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
  // The light model, the textures of planes and the skybox are mujoco_warp's. For an Appearance and
  // SurfaceAssets that are made so, too.
  bool as_mujoco_warp = false;
  bool warp_skybox = false;  // with as_mujoco_warp: a skybox, which hides no geoms
  PhysicalOptions physical;
};

}  // namespace mjsense::render
