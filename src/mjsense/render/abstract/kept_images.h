// SPDX-License-Identifier: Apache-2.0
#pragma once
// The last images of a renderer. Only the tiles of a new image that may differ from the most similar
// of them are rendered.

#include <list>
#include <vector>

#include "mjsense/render/view/changed_tiles.h"
#include "mjsense/render/view/tile_kernels.h"

namespace mjsense::render {

class KeptImages {
 public:
  // Renders the view's image. Of the targets, it uses rgb, depth and segmentation.
  void render(const View& view, const ImageTargets& targets, RenderTiles tiles,
              TileScratch& scratch);

  // Call when meshes or textures have changed that geoms or views refer to.
  void clear() { images_.clear(); }

 private:
  struct Image {
    ChangedTiles tiles;
    std::vector<std::uint8_t> rgb;
    std::vector<float> depth;
    std::vector<std::int32_t> segmentation;

    bool has(const ImageTargets& targets) const;
  };
  Image& most_similar(const View& view, const ImageTargets& targets);

  std::list<Image> images_;  // the last one that was used first
};

}  // namespace mjsense::render
