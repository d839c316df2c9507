// SPDX-License-Identifier: Apache-2.0
#pragma once
// Shadow casters of a tile: geoms whose windows in the light's image overlap the window of the
// tile's points and, for geoms of many triangles, the parts of them that do. This culling is
// conservative: it saves shadow rays and never changes a result. Part of the tile kernels.

#include "mjsense/render/kernels/light_window.h"
#include "mjsense/render/kernels/mesh_parts.h"

namespace mjsense::render {
namespace {

struct Casters {
  int* list;  // geom of each caster; a geom with several parts has consecutive entries
  LightWindows windows;
  int count;
  int hint;  // geom that shadowed the last lit lanes of the previous packet, or -1; tested first
  const LightFrame* frame;
  float error;  // position error in the tile, m

  void add(int geom, const LightWindows& from, int k) {
    list[count] = geom;
    windows.u_min[count] = from.u_min[k];
    windows.u_max[count] = from.u_max[k];
    windows.v_min[count] = from.v_min[k];
    windows.v_max[count] = from.v_max[k];
    windows.w_min[count++] = from.w_min[k];
  }
};

// Whether the plane may lie between the light and a point in the box. True if the plane touches
// either.
inline bool divides(const ViewGeom& plane, const ViewLight& light, const float* low,
                    const float* high, float error) {
  const float n[3] = {plane.rot[2], plane.rot[5], plane.rot[8]};
  float minimum = 0, maximum = 0, from = 0, along = 0;
  for (int i = 0; i < 3; ++i) {
    minimum += n[i] * ((n[i] > 0 ? low[i] : high[i]) - plane.pos[i]);
    maximum += n[i] * ((n[i] > 0 ? high[i] : low[i]) - plane.pos[i]);
    from += n[i] * (light.pos[i] - plane.pos[i]);
    along -= n[i] * light.dir[i];
  }
  const float lit = light.kind == LightKind::kDirectional ? along : from;
  return !((minimum > error && lit > 0) || (maximum < -error && lit < 0));
}

// Returns those of kWidth geoms from `first` on whose bounding box has a side that faces both the
// light and all points in the box around `middle`. Such geoms are not between them.
inline std::uint32_t turned_to(const FacingSides& sides, int first, Vec3f middle, Vec3f half,
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

// Maximum number of parts of one geom in one tile; a geom with more parts is one caster.
constexpr int kMaxParts = 48;

// Adds the parts of geom `index` that may shadow the points. If there are more than `maximum`
// parts, adds none and returns false. A node is not divided further once its window is no larger
// than that of all points together.
inline bool add_parts(const View& view, int index, const LitWindow& points, int maximum,
                      Casters& out) {
  const ViewGeom& g = view.geoms[index];
  const rays::Clusters& clusters = clusters_of(g);
  const SeenByLight seen(*out.frame, g, out.error);
  int waiting[rays::Clusters::kMaxWaiting];
  int left = 1;
  waiting[0] = 0;
  const int before = out.count;
  ChildWindows w;
  while (left) {
    const rays::ClusterNode& node = clusters.nodes[waiting[--left]];
    for (std::uint32_t near = seen.children(node, points, w); near; near &= near - 1) {
      const int k = __builtin_ctz(near);
      const bool wide =
          w.u1[k] - w.u0[k] > points.u1 - points.u0 || w.v1[k] - w.v0[k] > points.v1 - points.v0;
      if (wide && node.child[k] >= 0) {
        waiting[left++] = node.child[k];
      } else if (out.count < before + maximum) {
        out.add(index, {w.u0, w.u1, w.v0, w.v1, w.w}, k);
      } else {
        out.count = before;
        return false;
      }
    }
  }
  return true;
}

// Finds all casters of one light among `part` for points in a box: geoms, and at most `spare` parts
// of geoms. `only`: the geom to which all points belong, or -1.
inline void find_casters(const View& view, int light, Part part, const float* low,
                         const float* high, int only, int& spare, Casters& out) {
  const LightFrame& f = frame_towards(view.light_frames[light], low, high);
  float reach = 0, away = 0;
  alignas(64) float corners[3][kLanes];
  for (int c = 0; c < 3; ++c) {
    const float maximum = high[c] > -low[c] ? high[c] : -low[c];
    reach += maximum * maximum;
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
      near &= ~turned_to(view.facing_sides[light], i, splat(middle), splat(half), splat(out.error));
    for (; near; near &= near - 1) {
      const int g = i + __builtin_ctz(near);
      if (g >= view.num_geoms) break;
      const ViewGeom& geom = view.geoms[g];
      if (!belongs(geom, part)) continue;
      if (g == only && !has_triangles(geom)) continue;  // a convex geom casts no shadow on itself
      if (geom.type == mjGEOM_PLANE && !divides(geom, view.lights[light], low, high, out.error))
        continue;
      // A height field is always one caster: its own shadow rays are tested as a whole
      // (leaves_ground()).
      if (has_clusters(geom) && !geom.height_field) {
        const int before = out.count;
        if (add_parts(view, g, points, spare < kMaxParts ? spare : kMaxParts, out)) {
          spare -= out.count - before;
          continue;
        }
      }
      out.add(g, f.windows, g);
    }
  }
}

}  // namespace
}  // namespace mjsense::render
