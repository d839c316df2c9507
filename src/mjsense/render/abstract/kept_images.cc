// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/kept_images.h"

#include <algorithm>

namespace mjsense::render {
namespace {

// A program that draws several cameras in turns has an image of each.
constexpr std::size_t kMostImages = 4;

}  // namespace

bool KeptImages::Image::has(const ImageTargets& targets) const {
  return rgb.empty() == !targets.rgb && depth.empty() == !targets.depth &&
         segmentation.empty() == !targets.segmentation;
}

KeptImages::Image& KeptImages::most_similar(const View& view, const ImageTargets& targets) {
  auto best = images_.end();
  int most = 0;
  for (auto image = images_.begin(); image != images_.end(); ++image) {
    const int equal = image->has(targets) ? image->tiles.equal_geoms(view) : 0;
    if (equal <= most) continue;
    most = equal;
    best = image;
  }
  if (best == images_.end()) {
    if (images_.size() == kMostImages) {
      best = std::prev(images_.end());
    } else {
      best = images_.emplace(images_.begin());
    }
  }
  images_.splice(images_.begin(), images_, best);
  return images_.front();
}

void KeptImages::render(const View& view, const ImageTargets& targets, RenderTiles tiles,
                        TileScratch& scratch) {
  Image& image = most_similar(view, targets);
  const std::size_t pixels = static_cast<std::size_t>(view.grid.width) * view.grid.height;
  image.rgb.resize(targets.rgb ? 3 * pixels : 0);
  image.depth.resize(targets.depth ? pixels : 0);
  image.segmentation.resize(targets.segmentation ? 2 * pixels : 0);
  image.tiles.compare(view);
  ImageTargets images = targets;
  if (targets.rgb) images.rgb = image.rgb.data();
  if (targets.depth) images.depth = image.depth.data();
  if (targets.segmentation) images.segmentation = image.segmentation.data();
  images.changed_tiles = image.tiles.changed();
  images.receivers = image.tiles.receivers();
  tiles(view, images, 0, (view.grid.height + kTileSize - 1) / kTileSize, scratch);
  image.tiles.keep(view);
  std::ranges::copy(image.rgb, targets.rgb);
  std::ranges::copy(image.depth, targets.depth);
  std::ranges::copy(image.segmentation, targets.segmentation);
}

}  // namespace mjsense::render
