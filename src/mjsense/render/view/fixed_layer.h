// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a camera that stands still sees of geoms that stand still, which of it lies in their shadow,
// and its colours where nothing that moves casts one: found once, kept, and used for every image
// and world in which none of it has changed. Images are the same with and without it, bit for bit:
// kernels always draw the fixed part first.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <memory>
#include <vector>

#include "mjsense/render/view/view.h"

namespace mjsense {

// Bodies that stand still between resets: without a joint up to the world. A mocap body with
// children is the base of something and counts as such; one without is a target or marker, and
// moves.
bool is_fixed_body(const mjModel* model, int body);

class FixedLayer {
 public:
  // Whether the camera and all lights stand still.
  static bool possible(const mjModel* model, int camera);
  // Of the tiles: 48 a pixel. They are memory from when they are made on.
  static std::size_t bytes(int width, int height);

  FixedLayer(const mjModel* model, int width, int height);

  // To be asked with one view of every cast: true if its fixed part has become the same as the time
  // before, and tiles() are to be made of it now.
  bool settles(const View& view);
  // Whether tiles() are the fixed part of this view.
  bool shows(const View& view) const { return made_ && same(view); }
  FixedTile* tiles() { return tiles_.get(); }

 private:
  bool same(const View& view) const;

  std::unique_ptr<FixedTile[]> tiles_;
  bool made_ = false;
  // What it is of.
  PixelGrid grid_;
  std::vector<ViewGeom> geoms_;
  std::vector<ViewLight> lights_;
};

// The layers of a camera: one for all worlds that look the same, and one each for those that do not,
// because their lights, materials or camera poses are randomised.
class FixedLayers {
 public:
  // Of all worlds' own layers; worlds beyond have none, and are drawn anew.
  static constexpr std::size_t kMostBytes = std::size_t{256} << 20;

  FixedLayers(const mjModel* model, int width, int height, int num_worlds,
              std::size_t most_bytes = kMostBytes);

  // Tiles that show the fixed part of the world's view; null: none do.
  const FixedTile* find(int world, const View& view);
  // To be asked once before a cast, with the view of one of its worlds, then of every world that
  // find() has nothing for: the tiles that are to be made of the view's fixed part now; null: none.
  FixedTile* settle_common(int world, const View& view);
  FixedTile* settle(int world, const View& view);

 private:
  FixedLayer* own(int world) {
    return static_cast<std::size_t>(world) < own_.size() ? &own_[world] : nullptr;
  }

  FixedLayer common_;
  std::vector<FixedLayer> own_;  // of the first worlds
};

}  // namespace mjsense
