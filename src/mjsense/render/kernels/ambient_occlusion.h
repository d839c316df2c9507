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

// A sphere around points, and the greatest distance of their unit normals from one of them.
struct Patch {
  float center[3], radius, normal[3], bend;
};

// Which of kWidth boxes, from number i on, may hide the environment from the points of a patch. With
// `horizon` boxes are left out that are below the surface's horizon at all points.
template <bool horizon>
std::uint32_t boxes_near(const OccluderBoxes& boxes, int i, const Patch& patch) {
  using Boxes = OccluderBoxes;
  const auto row = [&](int k) { return loadu(boxes.row(k) + i); };
  const auto turned = [&](const float* v, int k) {
    return fma(row(Boxes::kRotation + k), splat(v[0]),
               fma(row(Boxes::kRotation + 3 + k), splat(v[1]),
                   row(Boxes::kRotation + 6 + k) * splat(v[2])));
  };
  Float square = splat(0.0f), top = splat(0.0f), size = splat(0.0f);
  for (int k = 0; k < 3; ++k) {
    const Float half = row(Boxes::kHalf + k);
    const Float local = turned(patch.center, k) + row(Boxes::kOrigin + k);
    const Float away = max(abs(local) - half, splat(0.0f));
    square = fma(away, away, square);
    if constexpr (horizon) {
      const Float normal = turned(patch.normal, k);
      top = top + fma(abs(normal), half, -(normal * local));
      size = size + half;
    }
  }
  const Float far = row(Boxes::kReach) + splat(patch.radius);
  const Mask near = (splat(0.0f) < far) & (square < far * far);
  if constexpr (!horizon) return bits(near);
  // By how much it may be higher at other points. Planes, which have no height, are always kept.
  const Float more = fma(splat(patch.bend), fma(splat(2.0f), size, far + splat(patch.radius)),
                         splat(patch.radius));
  return bits(near & ~((top + more < splat(0.0f)) & (splat(0.0f) < row(Boxes::kHalf + 2))));
}

// Finds those of `part` for points between `low` and `high`, in the memory of `scratch`.
inline void find_occluders(const View& view, Part part, const float* low, const float* high,
                           TileScratch& scratch, Occluders& out) {
  out = {scratch.occluders, scratch.occluder_boxes, 0, false};
  if (low[0] > high[0]) return;
  Patch patch{};
  float square = 0;
  for (int c = 0; c < 3; ++c) {
    patch.center[c] = 0.5f * (low[c] + high[c]);
    const float half = 0.5f * (high[c] - low[c]);
    square += half * half;
  }
  patch.radius = std::sqrt(square);
  for (int i = 0; i < view.num_geoms; i += kWidth) {
    for (std::uint32_t near = boxes_near<false>(view.occluders, i, patch); near; near &= near - 1) {
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

// angle / sin(angle) / (2 pi) of the angle with this cosine and this square of the sine; the error is
// below 1e-5. An interpolation at Chebyshev's points of [0, 1]; larger angles are those of the opposite
// vector.
inline Float relative_arc(Float cosine, Float square_sine) {
  constexpr float kFactors[] = {-0.0104833f, 0.0434695f,  -0.0858475f,
                                0.1208387f,  -0.1588203f, 0.2499954f};
  const Float y = abs(cosine);
  Float ratio = splat(kFactors[0]);
  for (int i = 1; i < 6; ++i) ratio = fma(ratio, y, splat(kFactors[i]));
  const Mask acute = splat(0.0f) < cosine;
  if (!any(~acute)) return ratio;
  const Float inverse_sine = inverse_sqrt(max(square_sine, splat(1e-14f)));
  return select(acute, ratio, fma(inverse_sine, splat(0.5f), -ratio));
}

// A box as seen from points, in the box's frame, mirrored so that each point is on the positive side of
// every axis: only the three faces there can face it. Index 0 is the nearer end of an axis, 1 the other.
class SeenBox {
 public:
  SeenBox(const float* half, Vec3f p, Vec3f n) : half_(half) {
    const Float at[3] = {p.x, p.y, p.z}, normal[3] = {n.x, n.y, n.z};
    for (int axis = 0; axis < 3; ++axis) {
      const Float away = abs(at[axis]);
      faces_[axis] = splat(half[axis]) < away;
      normal_[axis] = select(at[axis] < splat(0.0f), -normal[axis], normal[axis]);
      for (int end = 0; end < 2; ++end) {
        v_[axis][end] = splat(end == 0 ? half[axis] : -half[axis]) - away;
        square_[axis][end] = v_[axis][end] * v_[axis][end];
      }
    }
  }

  // Part of the cosine-weighted hemisphere around the normal that the faces hide, by Lambert's formula
  // for polygons. Faces share corners and edges.
  Float hidden() {
    const bool x = any(faces_[0]), y = any(faces_[1]), z = any(faces_[2]);
    if (x || y || z) find_scale(0, 0, 0);
    if (y || z) find_scale(1, 0, 0);
    if (z || x) find_scale(0, 1, 0);
    if (x || y) find_scale(0, 0, 1);
    Float near[3] = {splat(0.0f), splat(0.0f), splat(0.0f)};  // the edges from the nearest corner
    if (y || z) near[0] = edge<0>(0, 0);
    if (z || x) near[1] = edge<1>(0, 0);
    if (x || y) near[2] = edge<2>(0, 0);
    Float sum = splat(0.0f);
    if (x) {
      find_scale(0, 1, 1);
      add<0>(near, sum);
    }
    if (y) {
      find_scale(1, 0, 1);
      add<1>(near, sum);
    }
    if (z) {
      find_scale(1, 1, 0);
      add<2>(near, sum);
    }
    return sum;
  }

 private:
  void find_scale(int i, int j, int k) {
    const Float square = square_[0][i] + square_[1][j] + square_[2][k];
    scale_[i][j][k] = inverse_sqrt(max(square, splat(1e-12f)));
  }

  // The term of the edge along an axis, from its nearer to its farther end, which is at the ends j and k
  // of the next two axes.
  template <int axis>
  Float edge(int j, int k) const {
    constexpr int b = (axis + 1) % 3, c = (axis + 2) % 3;
    int from[3] = {}, to[3] = {};
    from[b] = to[b] = j;
    from[c] = to[c] = k;
    to[axis] = 1;
    const Float scale = scale_[from[0]][from[1]][from[2]] * scale_[to[0]][to[1]][to[2]];
    const Float across = square_[b][j] + square_[c][k];
    const Float cosine = fma(v_[axis][0], v_[axis][1], across) * scale;
    const Float length = splat(2 * half_[axis]) * scale;
    const Float turned = fma(v_[c][k], normal_[b], -(v_[b][j] * normal_[c]));
    return turned * length * relative_arc(cosine, across * length * length);
  }

  template <int axis>
  void add(const Float* near, Float& sum) const {
    constexpr int b = (axis + 1) % 3, c = (axis + 2) % 3;
    const Float face = near[b] - near[c] + edge<c>(0, 1) - edge<b>(1, 0);
    sum = sum + select(faces_[axis], max(face, splat(0.0f)), splat(0.0f));
  }

  const float* half_;
  Mask faces_[3];
  Float normal_[3], v_[3][2], square_[3][2], scale_[2][2][2];
};

// 1 at the geom and 0 at the distance `reach` (m) or more, of which `square` is the square.
inline Float fade(Float square, float reach) {
  const Float left = max(splat(1.0f) - square * splat(1 / (reach * reach)), splat(0.0f));
  return left * left;
}

// Part of the hemisphere around n that the sphere at `to` (from the point) hides.
inline Float hidden_by_sphere(Vec3f to, float radius, Vec3f n, float reach) {
  const Float zero = splat(0.0f), one = splat(1.0f);
  const Float square = max(dot(to, to), splat(1e-12f));
  const Float closeness = inverse_sqrt(square);
  const Float away = max(fma(square, closeness, splat(-radius)), zero);
  const Float size = min(splat(radius) * closeness, one);
  return max(dot(to, n) * closeness, zero) * size * size * fade(away * away, reach);
}

inline Float hidden_by_plane(const ViewGeom& g, Vec3f p, Vec3f n, float reach) {
  const Vec3f local = to_geom(g.rot, p - splat(g.pos));
  Mask over = splat(0.0f) < local.z;
  if (g.size[0] > 0) over = over & (abs(local.x) < splat(g.size[0]));
  if (g.size[1] > 0) over = over & (abs(local.y) < splat(g.size[1]));
  const Float below = fma(to_geom(g.rot, n).z, splat(-0.5f), splat(0.5f));
  return select(over, below * fade(local.z * local.z, reach), splat(0.0f));
}

// The smallest of three half sizes. Not std::min(), which would be an instance for this kernel's instruction set.
inline float thinnest(const float* half) {
  const float two = half[0] < half[1] ? half[0] : half[1];
  return two < half[2] ? two : half[2];
}

// Part of the hemisphere around n that a geom other than a plane hides from p. Boxes are exact; others are
// spheres swept in a box, as wide as the geom is along its thinnest axis.
inline Float hidden_by_solid(const ViewGeom& g, Mask lanes, Vec3f p, Vec3f n, float reach) {
  const Float zero = splat(0.0f);
  const float* half = g.aabb + 3;
  const bool box = g.type == mjGEOM_BOX;
  const float thick = box ? 0.0f : thinnest(half);
  const float swept[3] = {half[0] - thick, half[1] - thick, half[2] - thick};
  const Vec3f to_center = splat(g.center) - p, normal = to_geom(g.rot, n);
  // Height of what is swept above the surface's horizon.
  const Float top =
      dot(to_center, n) + fma(abs(normal.x), splat(swept[0]),
                              fma(abs(normal.y), splat(swept[1]), abs(normal.z) * splat(swept[2])));
  const Mask over = lanes & (splat(1e-5f) < top);
  if (!any(over)) return zero;
  const Vec3f center = to_geom(g.rot, to_center);
  const auto beyond = [](Float x, float h) { return x - min(max(x, splat(-h)), splat(h)); };
  const Vec3f to{beyond(center.x, swept[0]), beyond(center.y, swept[1]),
                 beyond(center.z, swept[2])};
  if (!box) return select(over, hidden_by_sphere(to, thick, normal, reach), zero);
  const Float near = fade(dot(to, to), reach);
  // What hides less than 1/500 is left out. A sphere around the box hides at most (radius / distance)^2.
  const Mask some =
      over & (splat(0.002f) * dot(center, center) < near * splat(g.radius * g.radius));
  if (!any(some)) return zero;
  const Vec3f at{-center.x, -center.y, -center.z};
  return select(some, SeenBox(half, at, normal).hidden() * near, zero);
}

inline Patch patch_of(const Surfaces& s, std::uint32_t lanes) {
  Patch out;
  const int first = __builtin_ctz(lanes);
  for (int c = 0; c < 3; ++c) {
    out.center[c] = s.p[c][first];
    out.normal[c] = s.n[c][first];
  }
  Float away = splat(0.0f), bend = splat(0.0f);
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f p = load3(s.p, k) - splat(out.center), n = load3(s.n, k) - splat(out.normal);
    const Mask those = mask_of(lanes >> k & kAllLanes);
    away = max(away, select(those, dot(p, p), splat(0.0f)));
    bend = max(bend, select(those, dot(n, n), splat(0.0f)));
  }
  out.radius = std::sqrt(lane_max(away));
  out.bend = std::sqrt(lane_max(bend));
  return out;
}

// Part of the environment's light that reaches the points of `lanes`, 0..1.
inline void open_sky(const View& view, const Occluders& tile, const Surfaces& s, const Hits& hits,
                     std::uint32_t lanes, float* out) {
  for (int k = 0; k < kLanes; k += kWidth) store(out + k, splat(1.0f));
  if (!lanes) return;
  const Patch patch = patch_of(s, lanes);
  for (int first = 0; first < tile.count; first += kWidth) {
    for (std::uint32_t near = boxes_near<true>(tile.boxes, first, patch); near; near &= near - 1) {
      const int i = first + __builtin_ctz(near);
      if (i >= tile.count) return;
      const ViewGeom& g = view.geoms[tile.list[i]];
      const float reach = tile.boxes.row(OccluderBoxes::kReach)[i];
      for (int k = 0; k < kLanes; k += kWidth) {
        const Vec3f p = load3(s.p, k), n = load3(s.n, k);
        const Mask other =
            mask_of(lanes >> k & kAllLanes) & ~(load(hits.geom + k) == int_of(tile.list[i]));
        const Float hidden = g.type == mjGEOM_PLANE
                                 ? select(other, hidden_by_plane(g, p, n, reach), splat(0.0f))
                                 : hidden_by_solid(g, other, p, n, reach);
        store(out + k, load(out + k) * (splat(1.0f) - min(hidden, splat(1.0f))));
      }
    }
  }
}

}  // namespace
}  // namespace mjsense::render
