// SPDX-License-Identifier: Apache-2.0
#pragma once
// Transparent geoms and planar reflections over the opaque surfaces of a packet. Part of the tile
// kernels.

#include "mjsense/render/kernels/physical_shading.h"
#include "mjsense/render/kernels/pixel_visibility.h"
#include "mjsense/render/kernels/tile_fixed_layer.h"

namespace mjsense::render {
namespace {

constexpr int kMaxMirrored = 32;  // maximum number of transparent geoms in a reflection
constexpr int kMaxLayers = 8;     // maximum number of transparent geoms over one packet

struct Layer {
  Colors color;
  alignas(64) float alpha[kLanes];  // 0: the layer does not cover the lane
};

inline void blend(const Layer& layer, Colors& out) {
  for (int k = 0; k < kLanes; k += kWidth) {
    const Float a = load(layer.alpha + k);
    for (int c = 0; c < 3; ++c) {
      const Float under = load(out.rgb[c] + k);
      store(out.rgb[c] + k, fma(a, load(layer.color.rgb[c] + k) - under, under));
    }
  }
}

// MuJoCo blends transparent geoms twice over the image: from near to far, and then from far to
// near. Physically based shading blends them from far to near only.
inline void shade_transparent(const View& view, const int* list, int count, const Pixels& pixels,
                              const Hits& opaque, Colors& out) {
  Layer layers[kMaxLayers];
  int used = 0;
  for (int i = 0; i < count && used < kMaxLayers; ++i) {
    if (!overlap(view.geoms[list[i]].window, pixels.window)) continue;
    Hits hits;
    clear(hits, kInfinity);
    for (int k = 0; k < kLanes; k += kWidth) store(hits.t + k, load(opaque.t + k));
    trace_geom(view, list[i], &pixels, &hits, 1u);
    const std::uint32_t lanes = hit_lanes(hits);
    if (!lanes) continue;
    Surfaces surfaces;
    gather_surfaces(view, pixels, hits, lanes, true, surfaces);
    Layer& layer = layers[used++];
    shade(view, surfaces, hits, lanes, nullptr, layer.color);
    for (int k = 0; k < kLanes; ++k) layer.alpha[k] = lanes >> k & 1u ? surfaces.alpha[k] : 0;
    if (!view.physical.on) blend(layer, out);
  }
  for (int i = used - 1; i >= 0; --i) blend(layers[i], out);
}

// The part of a tile that shows the mirror, and what is reflected there.
struct Reflection {
  std::uint32_t lanes[kTilePackets];  // lanes of each packet that show the mirror
  Tile tile;                          // the reflected view, for packets with such lanes
};

// Lanes of a packet that show the mirror. A box reflects only on its top.
inline std::uint32_t mirror_lanes(const View& view, const Pixels& pixels, const Hits& hits) {
  std::uint32_t lanes = 0;
  for (int k = 0; k < kLanes; k += kWidth)
    lanes |= bits(load(hits.id + k) == int_of(view.mirror_id)) << k;
  if (!lanes) return 0;
  const ViewGeom& g = view.geoms[hits.geom[__builtin_ctz(lanes)]];
  if (g.type != mjGEOM_BOX) return lanes;
  std::uint32_t top = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f q = hit_point(view, pixels, hits, k) - splat(g.pos);
    const Vec3f up{splat(g.rot[2]), splat(g.rot[5]), splat(g.rot[8])};
    top |= bits(splat(g.size[2] * 0.999f) < dot(q, up)) << k;
  }
  return lanes & top;
}

// Traces the reflected view in the tile. The tile's opaque geoms must already be traced. Returns the
// packets that show the mirror.
inline PacketMask trace_reflection(const View& view, int packets, const Tile& tile,
                                   Reflection& out) {
  PacketMask through = 0;
  for (int q = 0; q < packets; ++q) {
    const std::uint32_t lanes = out.lanes[q] = mirror_lanes(view, tile.pixels[q], tile.hits[q]);
    out.tile.farthest[q] = lanes ? kInfinity : -kInfinity;
    clear(out.tile.hits[q], kInfinity);
    if (!lanes) continue;
    through |= 1u << q;
    Pixels& pixels = out.tile.pixels[q];
    pixels = tile.pixels[q];
    for (int k = 0; k < kLanes; k += kWidth)
      store(pixels.near + k, select(mask_of(lanes >> k & kAllLanes),
                                    load(tile.hits[q].t + k) * splat(1.00001f), splat(kInfinity)));
  }
  if (!through) return 0;
  for (int q = packets; q < kTilePackets; ++q) out.tile.farthest[q] = -kInfinity;
  out.tile.regular = tile.regular;
  out.tile.keep = nullptr;
  out.tile.kept = nullptr;
  out.tile.shaded = true;
  out.tile.depth = kInfinity;
  __builtin_memcpy(out.tile.window, tile.window, sizeof tile.window);
  __builtin_memcpy(out.tile.around, tile.around, sizeof tile.around);
  const View& beyond = *view.reflection;
  for (int i = 0; i < beyond.num_opaque; ++i) {
    const ViewGeom& g = beyond.geoms[i];
    if (!overlap(g.window, tile.around)) continue;
    const PacketMask some = packets_in_reach(g.window, g.min_depth, out.tile);
    if (!some) continue;
    const PacketMask changed = draw_or_trace(beyond, i, some, out.tile);
    if (changed) update_farthest(out.tile, changed);
  }
  return through;
}

// Adds the reflection to the colour of packet `q`.
inline void add_reflection(const View& view, const Reflection& reflection, int q, Colors& out) {
  const std::uint32_t lanes = reflection.lanes[q];
  if (!lanes) return;
  const View& beyond = *view.reflection;
  const Pixels& through = reflection.tile.pixels[q];
  const Hits& found = reflection.tile.hits[q];
  const std::uint32_t seen = hit_lanes(found);
  if (!seen && beyond.num_transparent == 0) return;
  Colors color = {};
  if (seen) {
    Surfaces surfaces;
    gather_surfaces(beyond, through, found, seen, true, surfaces);
    shade(beyond, surfaces, found, seen, nullptr, color);
    for (int k = 0; k < kLanes; k += kWidth)  // lanes without a hit hold undefined values
      for (auto& c : color.rgb)
        store(c + k, select(mask_of(seen >> k & kAllLanes), load(c + k), splat(0.0f)));
  }
  int list[kMaxMirrored];
  int count = 0;
  while (count < beyond.num_transparent && count < kMaxMirrored) {
    list[count] = beyond.num_opaque + count;
    ++count;
  }
  if (count) shade_transparent(beyond, list, count, through, found, color);
  for (int k = 0; k < kLanes; k += kWidth) {
    const Mask m = mask_of((view.physical.on ? lanes & seen : lanes) >> k & kAllLanes);
    for (int c = 0; c < 3; ++c) {
      const Float own = load(out.rgb[c] + k), seen_there = load(color.rgb[c] + k);
      const Float both = view.physical.on
                             ? fma(splat(view.physical.reflectance), seen_there - own, own)
                             : min(own + seen_there, splat(1.0f));
      store(out.rgb[c] + k, select(m, both, own));
    }
  }
}

}  // namespace
}  // namespace mjsense::render
