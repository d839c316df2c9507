// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a camera cannot see for where it is: whole blocks of objects that stand beside the image or
// behind it are passed by (with shadows: those of which no shadow falls into it, shadow_reach.h).

#include <cstdint>
#include <vector>

#include "mjsense/render/view/view.h"

namespace mjsense {

class BoxList;

// The part of the world in which an image can show something: a pyramid, a slab of an orthographic
// camera.
class Frustum {
 public:
  // position, rotation: X_WC, row-major; grid.bent must be null.
  Frustum(const PixelGrid& grid, const double position[3], const double rotation[9]);

  // True: nothing of the box (corners in the world, m) can be in the image. False says nothing.
  bool misses(const float low[3], const float high[3]) const;

  // What stands between a light and something inside is inside, too: a light at a place, or parallel
  // light from direction `to_light` (unit) of which shadows are at most `longest` (m).
  void reach(const double light[3]);
  void reach(const double to_light[3], double longest);
  void widen(double by);  // m

 private:
  struct Side {
    double normal[3], offset;  // inside: normal . x <= offset
    double image;              // offset of what the image shows

    double along(const double v[3]) const {
      return normal[0] * v[0] + normal[1] * v[1] + normal[2] * v[2];
    }
  };
  Side sides_[5];
};

// Bit i of word i / 64 is set if object i of the list may be in the image.
void find_candidates(const BoxList& boxes, const Frustum& frustum,
                     std::vector<std::uint64_t>& candidates);

}  // namespace mjsense
