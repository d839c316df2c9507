// SPDX-License-Identifier: Apache-2.0
#pragma once
// Cached layer of a tile's fixed geoms, and the shadow casters of a tile. Part of the tile kernels.

#include "mjsense/render/kernels/physical_shading.h"
#include "mjsense/render/kernels/pixel_visibility.h"

namespace mjsense::render {
namespace {

inline std::uint32_t hit_lanes(const Hits& hits) {
  std::uint32_t lanes = 0;
  for (int k = 0; k < kLanes; k += kWidth)
    lanes |= bits(less(int_of(-1), load(hits.geom + k))) << k;
  return lanes;
}

// Lanes of a packet that show the same geom as the layer.
inline std::uint32_t fixed_lanes(const FixedTile& fixed, int packet, const Hits& hits) {
  std::uint32_t lanes = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Int id = load(hits.id + k), kept = load(fixed.id + packet * kLanes + k);
    lanes |= bits((id == kept) & less(int_of(-1), id)) << k;
  }
  return lanes;
}

// Bounds of what the tile shows. If a layer is given, pixels that show the layer are left out.
struct TileBounds {
  float low[3], high[3];  // bounding box, camera frame; low > high: empty
  int only;               // the geom to which everything belongs, or -1
};

inline TileBounds bounds_of_tile(const View& view, const FixedTile* fixed, const Tile& tile,
                                 int packets) {
  Float minimum[3], maximum[3];
  TileBounds out{{}, {}, -2};
  for (int c = 0; c < 3; ++c) {
    minimum[c] = splat(kInfinity);
    maximum[c] = splat(-kInfinity);
  }
  for (int q = 0; q < packets; ++q) {
    const Hits& hits = tile.hits[q];
    std::uint32_t lanes = hit_lanes(hits);
    if (fixed) lanes &= ~fixed_lanes(*fixed, q, hits);
    if (!lanes) continue;
    const int geom = hits.geom[__builtin_ctz(lanes)];
    if (out.only == -2) out.only = geom;
    for (int k = 0; k < kLanes; k += kWidth) {
      const Mask m = mask_of(lanes >> k & kAllLanes);
      const Int own = load(hits.geom + k);
      if (any(m & ~(own == int_of(out.only)))) out.only = -1;
      const Vec3f at = hit_point(view, tile.pixels[q], hits, k);
      const Float p[3] = {at.x, at.y, at.z};
      for (int c = 0; c < 3; ++c) {
        minimum[c] = min(minimum[c], select(m, p[c], splat(kInfinity)));
        maximum[c] = max(maximum[c], select(m, p[c], splat(-kInfinity)));
      }
    }
  }
  for (int c = 0; c < 3; ++c) {
    out.low[c] = lane_min(minimum[c]);
    out.high[c] = lane_max(maximum[c]);
  }
  return out;
}

inline void include(const TileBounds& bounds, TileBox& box) {
  for (int c = 0; c < 3; ++c) {
    box.low[c] = bounds.low[c] < box.low[c] ? bounds.low[c] : box.low[c];
    box.high[c] = bounds.high[c] > box.high[c] ? bounds.high[c] : box.high[c];
  }
}

// Finds the casters among `part` for every light. The lists start at index `used` of the scratch
// arrays.
inline void find_casters(const View& view, Part part, const TileBounds& bounds,
                         TileScratch& scratch, int& used, int& spare, Casters* out) {
  for (int i = 0; i < view.num_lights; ++i) {
    const LightWindows& w = scratch.caster_windows;
    out[i] = {scratch.casters + used,
              {w.u_min + used, w.u_max + used, w.v_min + used, w.v_max + used, w.w_min + used},
              0,
              -1,
              nullptr,
              0};
    if (!view.lights[i].casts_shadows || bounds.low[0] > bounds.high[0]) continue;
    find_casters(view, i, part, bounds.low, bounds.high, bounds.only, spare, out[i]);
    used += out[i].count;
  }
}

// `fixed`: the tile's layer, which stores the shadows that fixed geoms cast on fixed geoms; null if
// the view is not layered. `receivers`: if not null, grows to contain everything that the tile shows.
inline void find_all_casters(const View& view, const FixedTile* fixed, const Tile& tile,
                             int packets, TileScratch& scratch, Shadows& out, TileBox* receivers) {
  int used = 0, spare = scratch.max_caster_parts;
  out.known = fixed;
  for (int i = 0; i < view.num_lights; ++i) out.fixed[i].count = 0;
  const TileBounds all = bounds_of_tile(view, nullptr, tile, packets);
  if (receivers) include(all, *receivers);
  if (view.physical.occlusion_reach > 0)
    find_occluders(view, Part::kAll, all.low, all.high, scratch, out.near);
  if (!view.shadows) return;
  if (fixed) {
    find_casters(view, Part::kFixed, bounds_of_tile(view, fixed, tile, packets), scratch, used,
                 spare, out.fixed);
  }
  find_casters(view, fixed ? Part::kMoving : Part::kAll, all, scratch, used, spare, out.moving);
}

// Visits the arrays that a layer stores for packet `packet`, except depth and ids: visit(array of
// the hits, array of the layer).
template <class HitsOrConst, class TileOrConst, class Visit>
inline void each_kept(HitsOrConst& hits, int packet, TileOrConst& kept, Visit visit) {
  const int at = packet * kLanes;
  visit(hits.prim, kept.prim + at);
  visit(hits.u, kept.u + at);
  visit(hits.v, kept.v + at);
  for (int c = 0; c < 3; ++c) visit(hits.n[c], kept.n[c] + at);
}

template <class T>
inline void copy_lanes(const T* from, T* to) {
  for (int k = 0; k < kLanes; k += kWidth) store(to + k, load(from + k));
}

// Renders the fixed geoms among the first `count` of scratch.opaque into the tile and stores the
// result in `out`.
inline void make_fixed(const View& view, int count, int packets, Tile& tile, TileScratch& scratch,
                       FixedTile& out) {
  trace_tile(view, Part::kFixed, scratch.opaque_geoms, count, tile);
  Shadows shadows;
  const TileBounds bounds = bounds_of_tile(view, nullptr, tile, packets);
  if (view.physical.occlusion_reach > 0)
    find_occluders(view, Part::kFixed, bounds.low, bounds.high, scratch, shadows.near);
  if (view.shadows) {
    int used = 0, spare = scratch.max_caster_parts;
    find_casters(view, Part::kFixed, bounds, scratch, used, spare, shadows.fixed);
    for (int i = 0; i < view.num_lights; ++i) shadows.moving[i].count = 0;
  }
  for (int q = 0; q < packets; ++q) {
    const Hits& hits = tile.hits[q];
    copy_lanes(hits.t, out.t + q * kLanes);
    copy_lanes(hits.id, out.id + q * kLanes);
    each_kept(hits, q, out, [](const auto* from, auto* to) { copy_lanes(from, to); });
    const std::uint32_t lanes = hit_lanes(hits);
    if (!lanes) continue;
    Surfaces surfaces;
    gather_surfaces(view, tile.pixels[q], hits, lanes, true, surfaces);
    for (int i = 0; i < view.num_lights && view.shadows; ++i) {
      if (!view.lights[i].casts_shadows) continue;
      const Lit lit(view.lights[i], surfaces);
      const std::uint32_t dark = dark_lanes(view, i, lit, surfaces, hits, lanes, shadows);
      out.unlit[i][q] = static_cast<std::uint16_t>(dark & lanes);
    }
    Shadows known = shadows;
    known.known = &out;
    known.fixed_lanes = lanes;
    known.packet = q;
    Colors shaded;
    shade(view, surfaces, hits, lanes, needs_others(view) ? &known : nullptr, shaded);
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < kLanes; k += kWidth)
        store(out.rgb[c] + q * kLanes + k, load(shaded.rgb[c] + k));
  }
}

// Determines the dark lanes of a packet that shows only fixed geoms. Returns whether a moving geom
// casts a shadow on it.
inline bool settle(const View& view, const Pixels& pixels, const Hits& hits, std::uint32_t lanes,
                   Shadows& shadows) {
  Surfaces s;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f p = hit_point(view, pixels, hits, k);
    store(s.p[0] + k, p.x);
    store(s.p[1] + k, p.y);
    store(s.p[2] + k, p.z);
    // Normals are used only for self-shadows, which are already known.
    for (auto& n : s.n) store(n + k, splat(0.0f));
  }
  bool darker = false;
  for (int i = 0; i < view.num_lights; ++i) {
    const ViewLight& light = view.lights[i];
    const std::uint32_t known = shadows.known->unlit[i][shadows.packet];
    shadows.settled_dark[i] = known;
    if (!light.casts_shadows || shadows.moving[i].count == 0) continue;
    Lit lit;
    for (int k = 0; k < kLanes; k += kWidth) {
      LightTerm& term = lit.terms[k / kWidth];
      term.scale = term.diffuse = splat(1.0f);  // lanes that face away are already known to be dark
      term.to_light =
          light.kind == LightKind::kDirectional
              ? Vec3f{splat(-light.dir[0]), splat(-light.dir[1]), splat(-light.dir[2])}
              : splat(light.pos) - Vec3f{load(s.p[0] + k), load(s.p[1] + k), load(s.p[2] + k)};
    }
    shadows.settled_dark[i] = dark_lanes(view, i, lit, s, hits, lanes, shadows) & lanes;
    darker |= shadows.settled_dark[i] != known;
  }
  shadows.settled = true;
  return darker;
}

// Loads the colours of packet `packet` from the layer. Returns false if they no longer apply.
inline bool load_colors(const View& view, const FixedTile& kept, const Pixels& pixels,
                        const Hits& hits, std::uint32_t lanes, Shadows& shadows, Colors& out) {
  if (lanes != shadows.fixed_lanes || shadows.near.moving) return false;
  if (view.shadows && settle(view, pixels, hits, lanes, shadows)) return false;
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kLanes; k += kWidth)
      store(out.rgb[c] + k, load(kept.rgb[c] + shadows.packet * kLanes + k));
  return true;
}

// Restores the tile's depth and ids to the state after make_fixed().
inline void load_fixed(const View& view, const FixedTile& from, int packets, Tile& tile) {
  PacketMask shown = 0;
  for (int q = 0; q < packets; ++q) {
    Hits& hits = tile.hits[q];
    copy_lanes(from.t + q * kLanes, hits.t);
    copy_lanes(from.id + q * kLanes, hits.id);
    int last = -1, index = -1;
    for (int i = 0; i < kLanes; ++i) {
      if (hits.id[i] != last) {  // cache: most packets show few geoms
        last = hits.id[i];
        index = last < 0 ? -1 : view.geom_index[last];
      }
      hits.geom[i] = index;
    }
    if (hit_lanes(hits)) shown |= 1u << q;
  }
  if (shown) update_farthest(tile, shown);
}

// Restores the remaining arrays for those `lanes` of packet `q` that still show the layer. Most
// packets never need them, so they are loaded only on demand.
inline void load_rest(const FixedTile& from, int q, std::uint32_t lanes, Hits& hits) {
  each_kept(hits, q, from, [&](auto* to, const auto* kept) {
    for (int k = 0; k < kLanes; k += kWidth)
      store(to + k, select(mask_of(lanes >> k & kAllLanes), load(kept + k), load(to + k)));
  });
}

}  // namespace
}  // namespace mjsense::render
