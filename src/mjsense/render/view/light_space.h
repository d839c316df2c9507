// SPDX-License-Identifier: Apache-2.0
#pragma once
// Geoms in the image spaces of a view's lights. A geom can only shadow a point if it covers the
// same position in the light's image and is nearer to the light. The kernels test that before they
// cast a shadow ray.

#include <vector>

#include "mjsense/render/view/view.h"

namespace mjsense::render {

// Part of a light's image: u in [low[0], high[0]], v in [low[1], high[1]], and w.
struct LightWindow {
  float low[2], high[2];
  float w;
};

// Where the geom may shadow points: those in the window whose w is larger. The window is empty if
// the geom casts no shadow.
LightWindow shadow_window(const LightFrame& frame, const ViewGeom& geom);

// Contains the points in the box; their w is at most that of the window.
LightWindow lit_window(const LightFrame& frame, const TileBox& box);

// Owns View::light_frames and facing_sides of one view. fill() allocates nothing.
class LightSpace {
 public:
  // Maximum numbers of lights that cast shadows, and of geoms.
  LightSpace(int lights, std::size_t geoms);

  // Computes the frames of the view's lights that cast shadows, with the windows of its geoms.
  void fill(View& view);

 private:
  static constexpr int kArrays = 5, kSideArrays = 12;  // arrays in LightWindows and FacingSides

  std::size_t stride_;
  std::vector<LightFrame> frames_;
  std::vector<float> windows_, sides_;
};

}  // namespace mjsense::render
