// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/kernels/tile.h"

namespace mjsense::render {

void render_tiles_avx512(const View& view, const ImageTargets& targets, int first, int last,
                         TileScratch& scratch) {
  render_tiles(view, targets, first, last, scratch);
}

bool may_show_avx512(const ViewGeom& geom, const float* window) { return may_show(geom, window); }

}  // namespace mjsense::render
