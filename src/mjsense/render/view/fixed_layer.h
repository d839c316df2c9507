// SPDX-License-Identifier: Apache-2.0
#pragma once
// Cached layer of fixed geoms as seen by a fixed camera: their hits, the shadows they cast on each
// other, and their colours where no moving geom casts a shadow. It is rendered once and reused for
// every image and world in which none of its inputs has changed. Images are identical bit for bit
// with and without it, because the kernels always draw the fixed geoms first.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <memory>
#include <vector>

#include "mjsense/render/view/view.h"

namespace mjsense::render {

// Whether a body stays in place between resets: there is no joint between it and the world. A mocap
// body with children is the base of something and counts as fixed; one without children is a target
// or marker and counts as moving.
bool is_fixed_body(const mjModel* model, int body);

class FixedLayer {
 public:
  // Whether the camera and all lights are fixed.
  static bool possible(const mjModel* model, int camera);
  // Size of the tiles: 48 bytes per pixel. The memory is only committed once the tiles are written.
  static std::size_t bytes(int width, int height);

  FixedLayer(const mjModel* model, int width, int height);

  // Call once per cast, with one of its views. Returns true if the view's fixed part has become
  // equal to that of the previous call; then the caller must render tiles() now.
  bool settles(const View& view);
  // Whether tiles() show the fixed part of this view.
  bool shows(const View& view) const { return made_ && same(view); }
  FixedTile* tiles() { return tiles_.get(); }

 private:
  bool same(const View& view) const;

  std::unique_ptr<FixedTile[]> tiles_;
  bool made_ = false;
  // Inputs of the tiles.
  PixelGrid grid_;
  PhysicalView physical_;
  std::vector<ViewGeom> geoms_;
  std::vector<ViewLight> lights_;
};

// The layers of one camera: a common one for all worlds that look the same, and one for each world
// that differs because its lights, materials or camera poses are randomised.
class FixedLayers {
 public:
  // Maximum memory for the worlds' own layers. Further worlds have none and are always rendered in
  // full.
  static constexpr std::size_t kMaxBytes = std::size_t{256} << 20;

  FixedLayers(const mjModel* model, int width, int height, int num_worlds,
              std::size_t max_bytes = kMaxBytes);

  // Tiles that show the fixed part of the world's view, or null.
  const FixedTile* find(int world, const View& view);
  // settle_common() is called once before a cast, with the view of one of its worlds; settle() is
  // then called for every world for which find() returns null. Both return the tiles that the
  // caller must render from the view's fixed part now, or null.
  FixedTile* settle_common(int world, const View& view);
  FixedTile* settle(int world, const View& view);

 private:
  FixedLayer* own(int world) {
    return static_cast<std::size_t>(world) < own_.size() ? &own_[world] : nullptr;
  }

  FixedLayer common_;
  std::vector<FixedLayer> own_;  // of the first own_.size() worlds
};

}  // namespace mjsense::render
