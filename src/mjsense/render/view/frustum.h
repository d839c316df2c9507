// SPDX-License-Identifier: Apache-2.0
#pragma once
// Frustum culling: skips objects, and whole blocks of objects, that are outside the image or behind
// the camera. With shadows, shadow_reach.h first extends the frustum by the objects whose shadow
// may fall into the image.

#include <cstdint>
#include <vector>

#include "mjsense/render/view/pixel_grid.h"

namespace mjsense::rays {
class BoxList;
}  // namespace mjsense::rays

namespace mjsense::render {

// The part of the world that an image can show: a pyramid, or a box for an orthographic camera.
class Frustum {
 public:
  // position, rotation: X_WC, row-major; grid.distorted_rays must be null.
  Frustum(const PixelGrid& grid, const double position[3], const double rotation[9]);

  // True if no point of the box (corners in the world frame, m) can be in the image. False is not a
  // guarantee that it is visible.
  bool misses(const float low[3], const float high[3]) const;

  // Extends the region by everything that may lie between a light and a point inside. The first is
  // for a light with a position; the second for parallel light from direction `to_light` (unit)
  // whose shadows are at most `longest` (m) long.
  void reach(const double light[3]);
  void reach(const double to_light[3], double longest);
  void widen(double by);  // m

 private:
  struct Side {
    double normal[3], offset;  // inside: normal . x <= offset
    double image;              // offset without shadows and margins

    double along(const double v[3]) const {
      return normal[0] * v[0] + normal[1] * v[1] + normal[2] * v[2];
    }
  };
  Side sides_[5];
};

// Sets bit i % 64 of word i / 64 if object i of the list may be in the image, and clears the other
// bits.
void find_candidates(const rays::BoxList& boxes, const Frustum& frustum,
                     std::vector<std::uint64_t>& candidates);

}  // namespace mjsense::render
