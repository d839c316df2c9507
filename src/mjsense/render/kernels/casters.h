// SPDX-License-Identifier: Apache-2.0
#pragma once
// What may stand between a light and the points of a tile: geoms, and of shapes of many triangles
// the parts, whose windows in the light's image overlap that of the points. None of it is more than
// a reason not to cast a ray. Part of the tile kernels.

#include "mjsense/render/kernels/light_window.h"

namespace mjsense {
namespace {

struct Casters {
  int* list;  // geoms, one after another as often as parts of it are casters
  LightWindows windows;
  int count;
  int hint;  // the geom that did for the packet before, or -1; asked first, which only saves time
  const LightFrame* frame;
  float error;  // of positions of the tile, m

  void add(int geom, const LightWindows& from, int k) {
    list[count] = geom;
    windows.u0[count] = from.u0[k];
    windows.u1[count] = from.u1[k];
    windows.v0[count] = from.v0[k];
    windows.v1[count] = from.v1[k];
    windows.w[count++] = from.w[k];
  }
};

// Can the plane lie between the light and any point in the box? It can if they touch it.
inline bool divides(const ViewGeom& plane, const ViewLight& light, const float* low,
                    const float* high, float error) {
  const float n[3] = {plane.rot[2], plane.rot[5], plane.rot[8]};
  float least = 0, most = 0, from = 0, along = 0;
  for (int i = 0; i < 3; ++i) {
    least += n[i] * ((n[i] > 0 ? low[i] : high[i]) - plane.pos[i]);
    most += n[i] * ((n[i] > 0 ? high[i] : low[i]) - plane.pos[i]);
    from += n[i] * (light.pos[i] - plane.pos[i]);
    along -= n[i] * light.dir[i];
  }
  const float lit = light.kind == LightKind::kDirectional ? along : from;
  return !((least > error && lit > 0) || (most < -error && lit < 0));
}

// Of kWidth geoms from `first` on those of which a side of the bounding box faces the light and all
// points in the box around `middle`: they are not between them.
inline std::uint32_t turned_to(const LightSides& sides, int first, Vec3f middle, Vec3f half,
                               Float error) {
  Mask turned = mask_of(0);
  for (int i = 0; i < 3; ++i) {
    const float* const* n = sides.normal[i];
    const Vec3f normal{loadu(n[0] + first), loadu(n[1] + first), loadu(n[2] + first)};
    const Float nearest =
        dot(normal, middle) - dot({abs(normal.x), abs(normal.y), abs(normal.z)}, half);
    turned = turned | (loadu(sides.offset[i] + first) + error < nearest);
  }
  return bits(turned);
}

// The light's frame that looks to the middle of the box.
inline const LightFrame& frame_towards(const LightFrames& frames, const float* low,
                                       const float* high) {
  if (frames.count == 1) return *frames.first;
  int face = 0;
  float most = -1;
  for (int i = 0; i < 3; ++i) {
    const float x = 0.5f * (low[i] + high[i]) - frames.first->origin[i];
    const float size = x < 0 ? -x : x;
    if (size <= most) continue;
    most = size;
    face = 2 * i + (x < 0);
  }
  return frames.first[face];
}

constexpr int kMostParts = 48;  // of one geom for one tile; more are one caster

// Adds the parts of geom `index` that may stand before the points, at most `most`; false: there are
// more. Parts are not smaller in the light's image than the points are all together.
inline bool add_parts(const View& view, int index, const LitWindow& points, int most,
                      Casters& out) {
  const ViewGeom& g = view.geoms[index];
  const SeenByLight seen(*out.frame, g, out.error);
  int waiting[Clusters::kMaxWaiting];
  int left = 1;
  waiting[0] = 0;
  const int before = out.count;
  ChildWindows w;
  while (left) {
    const ClusterNode& node = g.clusters->nodes[waiting[--left]];
    for (std::uint32_t near = seen.children(node, points, w); near; near &= near - 1) {
      const int k = __builtin_ctz(near);
      const bool wide =
          w.u1[k] - w.u0[k] > points.u1 - points.u0 || w.v1[k] - w.v0[k] > points.v1 - points.v0;
      if (wide && node.child[k] >= 0) {
        waiting[left++] = node.child[k];
      } else if (out.count < before + most) {
        out.add(index, {w.u0, w.u1, w.v0, w.v1, w.w}, k);
      } else {
        out.count = before;
        return false;
      }
    }
  }
  return true;
}

// All casters of one light among `part` for points in a box: geoms, and at most `spare` parts of
// them. `only`: the geom on which all points lie, or -1.
inline void find_casters(const View& view, int light, Part part, const float* low,
                         const float* high, int only, int& spare, Casters& out) {
  const LightFrame& f = frame_towards(view.light_frames[light], low, high);
  float reach = 0, away = 0;
  alignas(64) float corners[3][kLanes];
  for (int c = 0; c < 3; ++c) {
    const float most = high[c] > -low[c] ? high[c] : -low[c];
    reach += most * most;
    away += f.origin[c] * f.origin[c];
    for (int i = 0; i < kLanes; ++i) corners[c][i] = i >> c & 1 ? high[c] : low[c];
  }
  out.frame = &f;
  out.error = kLightError * (__builtin_sqrtf(reach) + __builtin_sqrtf(away));
  const LitWindow points = window_of(f, corners, 0xffu, out.error);
  if (points.empty()) return;
  float middle[3], half[3];
  for (int c = 0; c < 3; ++c) {
    middle[c] = 0.5f * (low[c] + high[c]);
    half[c] = 0.5f * (high[c] - low[c]);
  }
  for (int i = 0; i < view.num_geoms; i += kWidth) {
    std::uint32_t near = overlaps(f.windows, i, points);
    if (near)
      near &= ~turned_to(view.light_sides[light], i, splat(middle), splat(half), splat(out.error));
    for (; near; near &= near - 1) {
      const int g = i + __builtin_ctz(near);
      if (g >= view.num_geoms) break;
      const ViewGeom& geom = view.geoms[g];
      if (!belongs(geom, part)) continue;
      if (g == only && !geom.bvh) continue;  // convex
      if (geom.type == mjGEOM_PLANE && !divides(geom, view.lights[light], low, high, out.error))
        continue;
      // Rays that leave a height field are asked about as a whole.
      if (geom.clusters && !geom.height_field) {
        const int before = out.count;
        if (add_parts(view, g, points, spare < kMostParts ? spare : kMostParts, out)) {
          spare -= out.count - before;
          continue;
        }
      }
      out.add(g, f.windows, g);
    }
  }
}

}  // namespace
}  // namespace mjsense
