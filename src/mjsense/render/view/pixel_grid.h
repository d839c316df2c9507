// SPDX-License-Identifier: Apache-2.0
#pragma once
// The rays of an image's pixels.

namespace mjsense::render {

// Pixel (x, y), row 0 at the top, has the ray from the origin along (X, Y, -1), with
// X = left + dx (x + 0.5) and Y = top + dy (y + 0.5). An orthographic camera's ray starts at
// (X, Y, 0), in m, and goes along (0, 0, -1). The parameter t of such a ray is planar depth, m.
struct PixelGrid {
  int width = 0, height = 0;  // pixels
  float left = 0, top = 0, dx = 0, dy = 0;
  bool orthographic = false;
  // [height, width, 2]: X and Y of each pixel for a lens with distortion. Null: use the formula
  // above.
  const float* distorted_rays = nullptr;

  bool operator==(const PixelGrid&) const = default;
};

}  // namespace mjsense::render
