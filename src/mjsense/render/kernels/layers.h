// SPDX-License-Identifier: Apache-2.0
#pragma once
// What lies before and inside the opaque surfaces of a packet: transparent geoms, reflections. Part
// of the tile kernels.

#include "mjsense/render/kernels/fixed.h"
#include "mjsense/render/kernels/shade.h"
#include "mjsense/render/kernels/trace.h"

namespace mjsense {
namespace {

constexpr int kMaxMirrored = 32;  // transparent geoms in a reflection
constexpr int kMaxLayers = 8;     // of transparent geoms over one packet

struct Layer {
  Colors color;
  alignas(64) float alpha[kLanes];  // 0: does not cover the lane
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

// MuJoCo draws transparent geoms twice, near to far and back, each time over what is there.
inline void shade_transparent(const View& view, const int* list, int count, const Pixels& pixels,
                              const Hits& opaque, Colors& out) {
  Layer layers[kMaxLayers];
  int used = 0;
  for (int i = 0; i < count && used < kMaxLayers; ++i) {
    if (!overlap(view.geoms[list[i]].window, pixels.window)) continue;
    Hits hits = opaque;
    for (int i = 0; i < kLanes; ++i) hits.geom[i] = hits.id[i] = -1;
    trace_geom(view, list[i], &pixels, &hits, 1u);
    const std::uint32_t lanes = hit_lanes(hits);
    if (!lanes) continue;
    Surfaces surfaces;
    gather_surfaces(view, pixels, hits, lanes, true, surfaces);
    Layer& layer = layers[used++];
    shade(view, surfaces, hits, lanes, nullptr, layer.color);
    for (int k = 0; k < kLanes; ++k) layer.alpha[k] = lanes >> k & 1u ? surfaces.alpha[k] : 0;
    blend(layer, out);
  }
  for (int i = used - 1; i >= 0; --i) blend(layers[i], out);
}

// The nearest of all opaque geoms in sight, for one packet.
inline void trace_opaque(const View& view, const Pixels& pixels, Hits& hits) {
  for (int i = 0; i < view.num_opaque; ++i) {
    const ViewGeom& g = view.geoms[i];
    bool beyond = false;
    for (int k = 0; k < kLanes; k += kWidth) beyond |= any(splat(g.nearest) < load(hits.t + k));
    if (!beyond) return;
    if (overlap(g.window, pixels.window)) trace_geom(view, i, &pixels, &hits, 1u);
  }
}

// What the mirror among `lanes` reflects, added to its colour. Of a box only the top is one.
inline void add_reflection(const View& view, const Pixels& pixels, const Hits& hits, Colors& out) {
  Mask some = mask_of(0);
  for (int k = 0; k < kLanes; k += kWidth) some = some | (load(hits.id + k) == int_of(view.mirror));
  if (!any(some)) return;
  const View& beyond = *view.reflection;
  Pixels through = pixels;
  std::uint32_t lanes = 0;
  for (int i = 0; i < kLanes; ++i) {
    bool mirror = hits.id[i] == view.mirror;
    if (mirror && view.geoms[hits.geom[i]].type == mjGEOM_BOX) {
      const ViewGeom& g = view.geoms[hits.geom[i]];
      const bool ortho = view.grid.orthographic;
      const float s = ortho ? 1.0f : hits.t[i];
      const float q[3] = {s * pixels.x[i] - g.pos[0], s * pixels.y[i] - g.pos[1],
                          -hits.t[i] - g.pos[2]};
      const float height = g.rot[2] * q[0] + g.rot[5] * q[1] + g.rot[8] * q[2];
      mirror = height > g.size[2] * 0.999f;
    }
    through.near[i] = mirror ? hits.t[i] * 1.00001f : kInfinity;
    lanes |= static_cast<std::uint32_t>(mirror) << i;
  }
  if (!lanes) return;
  Hits found;
  clear(found, kInfinity);
  trace_opaque(beyond, through, found);
  const std::uint32_t seen = hit_lanes(found);
  Colors color = {};
  if (seen) {
    Surfaces surfaces;
    gather_surfaces(beyond, through, found, seen, true, surfaces);
    shade(beyond, surfaces, found, seen, nullptr, color);
  }
  for (int k = 0; k < kLanes; k += kWidth)  // what lanes without a hit hold is no colour
    for (auto& c : color.rgb)
      store(c + k, select(mask_of(seen >> k & kAllLanes), load(c + k), splat(0.0f)));
  int list[kMaxMirrored];
  int count = 0;
  while (count < beyond.num_transparent && count < kMaxMirrored) {
    list[count] = beyond.num_opaque + count;
    ++count;
  }
  if (count) shade_transparent(beyond, list, count, through, found, color);
  for (int k = 0; k < kLanes; k += kWidth) {
    const Mask m = mask_of(lanes >> k & kAllLanes);
    for (int c = 0; c < 3; ++c) {
      const Float own = load(out.rgb[c] + k);
      store(out.rgb[c] + k, select(m, min(own + load(color.rgb[c] + k), splat(1.0f)), own));
    }
  }
}

}  // namespace
}  // namespace mjsense
