// SPDX-License-Identifier: Apache-2.0
#pragma once
// How much of the environment's light geoms hide from each other, by formula: boxes and planes exactly
// where they are above the surface's horizon, other geoms as spheres. There is no noise, and no ray is
// cast. Part of the tile kernels.

#include <cmath>

#include "mjsense/render/kernels/surfaces.h"
#include "mjsense/render/view/tile_kernels.h"

namespace mjsense::render {
namespace {

// The geoms that may hide the environment from the points of a tile, and their boxes.
struct Occluders {
  const int* list = nullptr;
  OccluderBoxes boxes;
  int count = 0;
  bool moving = false;  // some are not fixed
};

// Which of kWidth boxes, from number i on, may hide the environment from points in a sphere.
inline std::uint32_t boxes_near(const OccluderBoxes& boxes, int i, const float* center,
                                float radius) {
  using Boxes = OccluderBoxes;
  const auto row = [&](int k) { return loadu(boxes.row(k) + i); };
  const Float x = splat(center[0]), y = splat(center[1]), z = splat(center[2]);
  Float square = splat(0.0f);
  for (int k = 0; k < 3; ++k) {
    const Float local = fma(row(Boxes::kRotation + k), x,
                            fma(row(Boxes::kRotation + 3 + k), y,
                                fma(row(Boxes::kRotation + 6 + k), z, row(Boxes::kOrigin + k))));
    const Float away = max(abs(local) - row(Boxes::kHalf + k), splat(0.0f));
    square = fma(away, away, square);
  }
  const Float far = row(Boxes::kReach) + splat(radius);
  return bits((splat(0.0f) < far) & (square < far * far));
}

// Finds those of `part` for points between `low` and `high`, in the memory of `scratch`.
inline void find_occluders(const View& view, Part part, const float* low, const float* high,
                           TileScratch& scratch, Occluders& out) {
  out = {scratch.occluders, scratch.occluder_boxes, 0, false};
  if (low[0] > high[0]) return;
  float center[3], square = 0;
  for (int c = 0; c < 3; ++c) {
    center[c] = 0.5f * (low[c] + high[c]);
    const float half = 0.5f * (high[c] - low[c]);
    square += half * half;
  }
  const float radius = std::sqrt(square);
  for (int i = 0; i < view.num_geoms; i += kWidth) {
    for (std::uint32_t near = boxes_near(view.occluders, i, center, radius); near;
         near &= near - 1) {
      const int g = i + __builtin_ctz(near);
      if (g >= view.num_geoms) return;
      if (!belongs(view.geoms[g], part)) continue;
      scratch.occluders[out.count] = g;
      for (int k = 0; k < OccluderBoxes::kRows; ++k)
        out.boxes.row(k)[out.count] = view.occluders.row(k)[g];
      ++out.count;
      out.moving |= !view.geoms[g].fixed;
    }
  }
}

// angle / sin(angle) / (2 pi) of the angle between unit vectors with this cross product; the error is
// below 1e-5. An interpolation at Chebyshev's points of [0, 1]; larger angles are those of the opposite
// vector.
inline Float relative_arc(Float cosine, Vec3f cross) {
  constexpr float kFactors[] = {-0.0104833f, 0.0434695f,  -0.0858475f,
                                0.1208387f,  -0.1588203f, 0.2499954f};
  const Float y = abs(cosine);
  Float ratio = splat(kFactors[0]);
  for (int i = 1; i < 6; ++i) ratio = fma(ratio, y, splat(kFactors[i]));
  const Mask acute = splat(0.0f) < cosine;
  if (!any(~acute)) return ratio;
  const Float inverse_sine = inverse_sqrt(max(dot(cross, cross), splat(1e-14f)));
  return select(acute, ratio, fma(inverse_sine, splat(0.5f), -ratio));
}

// Part of the cosine-weighted hemisphere around n that a box hides from the point p; all in the box's
// frame. Lambert's formula for polygons, summed over the sides that face the point.
inline Float hidden_by_box(const float* half, Vec3f p, Vec3f n) {
  const Float zero = splat(0.0f);
  const Float at[3] = {p.x, p.y, p.z};
  Float sum = zero;
  for (int axis = 0; axis < 3; ++axis) {
    const Mask faces = splat(half[axis]) < abs(at[axis]);
    if (!any(faces)) continue;
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    const Float side = select(at[axis] < zero, splat(-half[axis]), splat(half[axis]));
    Vec3f corner[4];
    for (int c = 0; c < 4; ++c) {
      Float v[3];
      v[axis] = side - at[axis];
      v[i] = splat(c == 0 || c == 3 ? -half[i] : half[i]) - at[i];
      v[j] = splat(c < 2 ? -half[j] : half[j]) - at[j];
      const Vec3f to{v[0], v[1], v[2]};
      const Float scale = inverse_sqrt(max(dot(to, to), splat(1e-12f)));
      corner[c] = {to.x * scale, to.y * scale, to.z * scale};
    }
    Float face = zero;
    for (int c = 0; c < 4; ++c) {
      const Vec3f a = corner[c], b = corner[(c + 1) % 4];
      const Vec3f across = cross(a, b);
      face = fma(dot(across, n), relative_arc(dot(a, b), across), face);
    }
    // The corners turn the other way round where the point is on the negative side.
    face = select(at[axis] < zero, face, -face);
    sum = sum + select(faces, max(face, zero), zero);
  }
  return sum;
}

// 1 at the geom and 0 at the distance `reach` (m) or more, of which `square` is the square.
inline Float fade(Float square, float reach) {
  const Float left = max(splat(1.0f) - square * splat(1 / (reach * reach)), splat(0.0f));
  return left * left;
}

// Part of the hemisphere that a sphere at `to` (from the point) hides.
inline Float hidden_by_sphere(Vec3f to, float radius, Vec3f n, float reach) {
  const Float zero = splat(0.0f), one = splat(1.0f);
  const Float square = max(dot(to, to), splat(1e-12f));
  const Float closeness = inverse_sqrt(square);
  const Float away = max(fma(square, closeness, splat(-radius)), zero);
  const Float size = min(splat(radius) * closeness, one);
  return max(dot(to, n) * closeness, zero) * size * size * fade(away * away, reach);
}

// A geom in its own frame, as a sphere swept along its longer axes.
inline Float hidden_by_rounded(const float* half, Vec3f p, Vec3f n, float reach) {
  const float thin = half[0] < half[1] ? (half[0] < half[2] ? half[0] : half[2])
                                       : (half[1] < half[2] ? half[1] : half[2]);
  const auto nearest = [&](Float x, float h) {
    return min(max(x, splat(thin - h)), splat(h - thin));
  };
  const Vec3f to{nearest(p.x, half[0]) - p.x, nearest(p.y, half[1]) - p.y,
                 nearest(p.z, half[2]) - p.z};
  return hidden_by_sphere(to, thin, n, reach);
}

inline Float hidden_by(const ViewGeom& g, Vec3f p, Vec3f n, float reach) {
  const Float zero = splat(0.0f);
  const Vec3f local = to_geom(g.rot, p - splat(g.pos));
  const Vec3f normal = to_geom(g.rot, n);
  if (g.type == mjGEOM_PLANE) {
    Mask over = zero < local.z;
    if (g.size[0] > 0) over = over & (abs(local.x) < splat(g.size[0]));
    if (g.size[1] > 0) over = over & (abs(local.y) < splat(g.size[1]));
    const Float below = fma(normal.z, splat(-0.5f), splat(0.5f));
    return select(over, below * fade(local.z * local.z, reach), zero);
  }
  if (g.type == mjGEOM_SPHERE) {
    const Vec3f to{-local.x, -local.y, -local.z};
    return hidden_by_sphere(to, g.size[0], normal, reach);
  }
  const Vec3f q = local - splat(g.aabb);
  const float* half = g.aabb + 3;
  if (g.type != mjGEOM_BOX) return hidden_by_rounded(half, q, normal, reach);
  const auto beyond = [&](Float x, float h) { return max(abs(x) - splat(h), zero); };
  const Vec3f away{beyond(q.x, half[0]), beyond(q.y, half[1]), beyond(q.z, half[2])};
  const Float near = fade(dot(away, away), reach);
  // The corner that is highest above the surface's horizon.
  const Float top = fma(abs(normal.x), splat(half[0]),
                        fma(abs(normal.y), splat(half[1]), abs(normal.z) * splat(half[2]))) -
                    dot(normal, q);
  const Mask some = (zero < near) & (splat(1e-5f) < top);
  if (!any(some)) return zero;
  return select(some, hidden_by_box(half, q, normal) * near, zero);
}

// A sphere around the points of `lanes`.
inline float sphere_around(const Surfaces& s, std::uint32_t lanes, float* center) {
  const int first = __builtin_ctz(lanes);
  for (int c = 0; c < 3; ++c) center[c] = s.p[c][first];
  Float square = splat(0.0f);
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f away = load3(s.p, k) - splat(center);
    square = max(square, select(mask_of(lanes >> k & kAllLanes), dot(away, away), splat(0.0f)));
  }
  return std::sqrt(lane_max(square));
}

// Part of the environment's light that reaches the points of `lanes`, 0..1.
inline void open_sky(const View& view, const Occluders& tile, const Surfaces& s, const Hits& hits,
                     std::uint32_t lanes, float* out) {
  for (int k = 0; k < kLanes; k += kWidth) store(out + k, splat(1.0f));
  if (!lanes) return;
  float center[3];
  const float radius = sphere_around(s, lanes, center);
  for (int first = 0; first < tile.count; first += kWidth) {
    for (std::uint32_t near = boxes_near(tile.boxes, first, center, radius); near;
         near &= near - 1) {
      const int i = first + __builtin_ctz(near);
      if (i >= tile.count) return;
      const ViewGeom& g = view.geoms[tile.list[i]];
      const float reach = tile.boxes.row(OccluderBoxes::kReach)[i];
      for (int k = 0; k < kLanes; k += kWidth) {
        const Vec3f p = load3(s.p, k), n = load3(s.n, k);
        // Lanes in which the geom is not wholly below the horizon of the surface.
        const Mask over = g.type == mjGEOM_PLANE ? mask_of(kAllLanes)
                                                 : splat(-g.radius) < dot(splat(g.center) - p, n);
        const Mask other =
            mask_of(lanes >> k & kAllLanes) & over & ~(load(hits.geom + k) == int_of(tile.list[i]));
        if (!any(other)) continue;
        const Float hidden = min(hidden_by(g, p, n, reach), splat(1.0f));
        store(out + k, load(out + k) * (splat(1.0f) - select(other, hidden, splat(0.0f))));
      }
    }
  }
}

}  // namespace
}  // namespace mjsense::render
