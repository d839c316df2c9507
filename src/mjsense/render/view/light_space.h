// SPDX-License-Identifier: Apache-2.0
#pragma once
// Geoms as the lights of a view see them: what can stand between a light and a point lies in the
// same place of the light's image, and nearer. Kernels ask that before they cast a ray.

#include <vector>

#include "mjsense/render/view/view.h"

namespace mjsense {

// Owns View::light_frames and light_sides of one view; fill() allocates nothing.
class LightSpace {
 public:
  // At most so many lights that cast shadows, and geoms.
  LightSpace(int lights, std::size_t geoms);

  // Of the view's lights that cast shadows, and its geoms.
  void fill(View& view);

 private:
  static constexpr int kArrays = 5, kSideArrays = 12;  // of LightWindows, LightSides

  std::size_t stride_;
  std::vector<LightFrame> frames_;
  std::vector<float> windows_, sides_;
};

}  // namespace mjsense
