// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/kernels/tile.h"

namespace mjsense::render {

void render_tiles_portable(const View& view, const ImageTargets& targets, int first, int last,
                           TileScratch& scratch) {
  render_tiles(view, targets, first, last, scratch);
}

bool may_show_portable(const ViewGeom& geom, const float* window) { return may_show(geom, window); }

std::size_t tile_bytes() { return sizeof(TileSpace); }

}  // namespace mjsense::render
