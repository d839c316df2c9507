// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a camera that stands still sees of geoms that stand still, which of it lies in their shadow,
// and its colours where nothing that moves casts one: found once, kept, and used for every image
// and world in which none of it has changed. Images are the same with and without it, bit for bit:
// kernels always draw the fixed part first.

#include <mujoco/mujoco.h>

#include <vector>

#include "mjsense/render/view/view.h"

namespace mjsense {

// Bodies that stand still between resets: without a joint up to the world. A mocap body with
// children is the base of something and counts as such; one without is a target or marker, and
// moves.
bool is_fixed_body(const mjModel* model, int body);

class FixedLayer {
 public:
  // Whether the camera and all lights that cast shadows stand still, and there is such a light.
  static bool possible(const mjModel* model, int camera);

  // 48 bytes a pixel.
  FixedLayer(const mjModel* model, int width, int height);

  // To be asked with one view of every cast: true if its fixed part has become the same as the time
  // before, and tiles() are to be made of it now.
  bool settles(const View& view);
  // Whether tiles() are the fixed part of this view.
  bool shows(const View& view) const { return made_ && same(view); }
  FixedTile* tiles() { return tiles_.data(); }

 private:
  bool same(const View& view) const;

  std::vector<FixedTile> tiles_;
  bool made_ = false;
  // What it is of.
  PixelGrid grid_;
  std::vector<ViewGeom> geoms_;
  std::vector<ViewLight> lights_;
};

}  // namespace mjsense
