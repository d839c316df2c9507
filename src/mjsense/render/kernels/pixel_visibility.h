// SPDX-License-Identifier: Apache-2.0
#pragma once
// Visibility of a tile's pixels: by casting rays, or by rasterising where that is cheaper. Part of
// the tile kernels.

#include "mjsense/render/kernels/raster.h"
#include "mjsense/render/kernels/trace.h"

namespace mjsense::render {
namespace {

inline void update_farthest(Tile& tile, PacketMask packets) {
  for (; packets; packets &= packets - 1) {
    const int q = __builtin_ctz(packets);
    Float far = load(tile.hits[q].t);
    for (int k = kWidth; k < kLanes; k += kWidth) far = max(far, load(tile.hits[q].t + k));
    tile.farthest[q] = lane_max(far);
  }
  Float depth = load(tile.farthest);
  for (int k = kWidth; k < kTilePackets; k += kWidth) depth = max(depth, load(tile.farthest + k));
  tile.depth = lane_max(depth);
}

// Rasterises or traces geom `index` and stores hits that are nearer than the tile's. Returns the
// packets that changed.
inline PacketMask draw_or_trace(const View& view, int index, PacketMask packets, Tile& tile) {
  const ViewGeom& g = view.geoms[index];
  PacketMask changed = 0;
  if (has_clusters(g) && !view.grid.orthographic &&
      rasterize(view, index, packets, tile, changed)) {
    if (g.height_field)
      changed |= trace_walls(Tracing(view, index), tile.pixels, tile.hits, packets);
    return changed;
  }
  return trace_geom(view, index, tile.pixels, tile.hits, packets);
}

// Finds the nearest hits of all packets among the geoms of `list` that belong to `part`. `list`
// must be sorted by ViewGeom::nearest.
inline void trace_tile(const View& view, Part part, const int* list, int count, Tile& tile) {
  for (int i = 0; i < count; ++i) {
    const ViewGeom& g = view.geoms[list[i]];
    if (!belongs(g, part)) continue;
    const PacketMask packets = packets_in_reach(g.window, g.min_depth, tile);
    if (!packets) continue;
    const PacketMask changed = draw_or_trace(view, list[i], packets, tile);
    if (changed) update_farthest(tile, changed);
  }
}

// Adds transparent geoms to the hits, because depth and segmentation include them. A plane seen
// from behind is skipped unless the view says otherwise.
inline void trace_transparent(const View& view, const int* list, int count, Tile& tile) {
  for (int i = 0; i < count; ++i) {
    const ViewGeom& g = view.geoms[list[i]];
    if (g.type == mjGEOM_PLANE && g.shows_back && !view.shows_plane_backs) continue;
    const PacketMask packets = packets_in_reach(g.window, g.min_depth, tile);
    if (packets) draw_or_trace(view, list[i], packets, tile);
  }
}

}  // namespace
}  // namespace mjsense::render
