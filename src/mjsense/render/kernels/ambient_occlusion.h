// SPDX-License-Identifier: Apache-2.0
#pragma once
// How much of the environment's light geoms hide from each other, where they are and what colour they have,
// by formula: planes exactly, boxes by the solid angle that they cover, other geoms as spheres swept in a
// box. There is no noise, and no ray is cast. Part of the tile kernels.

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

// Points of surfaces, by one of them and its unit normal.
struct Patch {
  float center[3], normal[3];
  float radius;  // the greatest distance of a point from the center
  float depth;   // how far points are below the plane through the center
  float bend;    // the greatest distance of a normal from that of the center
};

// Geoms that hide a smaller part of the environment are left out. It is subtracted from what the others
// hide, so that images have no edge where a geom is left out.
constexpr float kLeastHidden = 1.0f / 256;
constexpr float kNearest = 1e-6f;  // m, the distance of what touches a point

// The square root, or less below 1e-12.
inline Float length_of(Float square) { return square * inverse_sqrt(max(square, splat(1e-12f))); }

// 1 at the geom and 0 where the square of the distance times `scale` is 1 or more.
inline Float fade(Float square, Float scale) {
  const Float left = max(fma(-square, scale, splat(1.0f)), splat(0.0f));
  return left * left;
}

// Whether what is seen at the distance d (m) or more, at most `height` above the horizon, may hide as much as
// kLeastHidden. It covers at most area / d^2 of the hemisphere, which counts by the cosine height / d.
// `fades`: from fade(). 2 % are for rounding.
inline Mask may_hide(Float d, Float height, Float area, Float fades) {
  return splat(0.98f * kLeastHidden) * d * d * d < max(min(height, d), splat(0.0f)) * area * fades;
}

// The area of a box, or less if it hides less because it is low: of the hemisphere, half of the directions
// below the height are height^2 / (2 d^2).
inline Float area_above(Float d, Float height, Float area) {
  return min(area, splat(0.5f) * d * max(min(height, d), splat(0.0f)));
}

// Which of kWidth occluders, from number i on, may hide at least kLeastHidden from one of the points of a
// patch. With `horizon` those are left out that are too low above the surface at all points.
template <bool horizon>
std::uint32_t occluders_near(const OccluderBoxes& boxes, int i, const Patch& patch) {
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
  // The least distance and the greatest height above the horizon for all points.
  const Float center = length_of(square);
  Float area = row(Boxes::kArea);
  const Float d = max(center - splat(patch.radius), splat(kNearest));
  const Float gap = max(d - row(Boxes::kRadius), splat(0.0f));
  Float height = d;
  if constexpr (horizon) {
    const Float other = center + splat(patch.radius);  // the greatest distance
    const Float more =
        fma(splat(patch.bend), fma(splat(2.0f), size, other), splat(patch.depth + 1e-5f));
    // A sphere that is cut by the horizon counts less than if its half were above.
    const Float counted = max(top, splat(0.5f) * (top + row(Boxes::kRadius)));
    // Planes, which have no height, are kept.
    height = select(area < splat(kInfinity), counted + more, d);
  }
  if constexpr (horizon)
    area = select(splat(0.0f) < row(Boxes::kRadius), area, area_above(d, height, area));
  return bits(may_hide(d, height, area, fade(gap * gap, row(Boxes::kFade))));
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
    for (std::uint32_t near = occluders_near<false>(view.occluders, i, patch); near;
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

// Part of the cosine-weighted hemisphere around a normal that a geom hides, and the direction of the geom
// (unit length, in the geom's frame).
struct Hidden {
  Float part;
  Vec3f toward;
};

// Part of the cosine-weighted hemisphere around a normal that a cone hides. `sine`: of its half angle,
// `cosine`: of its axis to the normal. Exact where the cone is above or below the horizon, and where it is
// a half space; otherwise within 0.04 (compared with sampled cones).
inline Float above_horizon(Float sine, Float cosine) {
  const Float whole = sine * sine, square = whole * whole, fourth = square * square;
  const Float low = max(cosine, -sine) + sine, high = sine - cosine;
  const Float cut = splat(0.25f) * sine * low * fma(high, fourth * fourth, low);
  return select(sine < cosine, whole * cosine, cut);
}

// A box as seen from points, in the box's frame, mirrored so that each point is on the positive side of
// every axis: only the three faces there can face it. Index 0 is the nearer end of an axis, 1 the other.
class SeenBox {
 public:
  SeenBox(const float* half, const Float* at, const Float* normal) : half_(half) {
    for (int axis = 0; axis < 3; ++axis) {
      const Float away = abs(at[axis]);
      faces_[axis] = splat(half[axis]) < away;
      seen_[axis] = select(faces_[axis], splat(1.0f), splat(0.0f));
      sum_[axis] = splat(0.0f);
      below_[axis] = at[axis] < splat(0.0f);
      normal_[axis] = select(below_[axis], -normal[axis], normal[axis]);
      for (int end = 0; end < 2; ++end) {
        v_[axis][end] = splat(end == 0 ? half[axis] : -half[axis]) - away;
        square_[axis][end] = v_[axis][end] * v_[axis][end];
      }
    }
  }

  // What the faces hide. Lambert's formula for polygons gives a vector, the sum over the edges of the
  // outline: its length is the part that would be hidden if the normal had its direction. The horizon cuts
  // the outline like a cone for which this part is the same.
  Hidden hidden() {
    const bool x = any(faces_[0]), y = any(faces_[1]), z = any(faces_[2]);
    if (y || z) find_scale(1, 0, 0);
    if (z || x) find_scale(0, 1, 0);
    if (x || y) find_scale(0, 0, 1);
    if (x) add_far_edges<0>();
    if (y) add_far_edges<1>();
    if (z) add_far_edges<2>();
    find_scale(0, 0, 0);
    add_near_edge<0>();
    add_near_edge<1>();
    add_near_edge<2>();
    const auto dot3 = [&](const Float* v) {
      return fma(sum_[0], v[0], fma(sum_[1], v[1], sum_[2] * v[2]));
    };
    const Float square = max(dot3(sum_), splat(1e-12f)), scale = inverse_sqrt(square);
    const Float length = min(square * scale, splat(1.0f));  // the part around its own direction
    const Float part = above_horizon(length * inverse_sqrt(length), dot3(normal_) * scale);
    const auto mirrored = [&](int axis) {
      const Float v = sum_[axis] * scale;
      return select(below_[axis], -v, v);
    };
    return {part, {mirrored(0), mirrored(1), mirrored(2)}};
  }

 private:
  void find_scale(int i, int j, int k) {
    const Float square = square_[0][i] + square_[1][j] + square_[2][k];
    scale_[i][j][k] = inverse_sqrt(max(square, splat(1e-12f)));
  }

  // Adds `factor` times the edge along an axis, from its nearer to its farther end, which is at the ends j
  // and k of the next two axes.
  template <int axis>
  void add_edge(int j, int k, Float factor) {
    constexpr int b = (axis + 1) % 3, c = (axis + 2) % 3;
    int from[3] = {}, to[3] = {};
    from[b] = to[b] = j;
    from[c] = to[c] = k;
    to[axis] = 1;
    const Float scale = scale_[from[0]][from[1]][from[2]] * scale_[to[0]][to[1]][to[2]];
    const Float across = square_[b][j] + square_[c][k];
    const Float cosine = fma(v_[axis][0], v_[axis][1], across) * scale;
    const Float length = splat(2 * half_[axis]) * scale;
    const Float arc = factor * length * relative_arc(cosine, across * length * length);
    sum_[b] = fma(v_[c][k], arc, sum_[b]);
    sum_[c] = fma(-v_[b][j], arc, sum_[c]);
  }

  // The edges of a face that end at its farthest corner.
  template <int axis>
  void add_far_edges() {
    constexpr int b = (axis + 1) % 3, c = (axis + 2) % 3;
    int corner[3] = {1, 1, 1};
    corner[axis] = 0;
    find_scale(corner[0], corner[1], corner[2]);
    add_edge<c>(0, 1, seen_[axis]);
    add_edge<b>(1, 0, -seen_[axis]);
  }

  // The edge that starts at the nearest corner, which is inside the outline if both of its faces are seen.
  template <int axis>
  void add_near_edge() {
    constexpr int b = (axis + 1) % 3, c = (axis + 2) % 3;
    const Float factor = seen_[c] - seen_[b];
    if (any(splat(0.0f) < abs(factor))) add_edge<axis>(0, 0, factor);
  }

  const float* half_;
  Mask faces_[3], below_[3];
  Float seen_[3];  // 1: the face is seen, 0: it is not
  Float sum_[3];
  Float normal_[3], v_[3][2], square_[3][2], scale_[2][2][2];
};

// What occluder i, a geom of this type, hides from p in these lanes. The sphere of a rounded geom is where
// it is nearest.
inline Hidden hidden_by(const OccluderBoxes& boxes, int i, int type, Mask lanes, Vec3f p, Vec3f n) {
  using Boxes = OccluderBoxes;
  const auto value = [&](int k) { return splat(boxes.row(k)[i]); };
  const auto turned = [&](Vec3f v, int k) {
    return fma(value(Boxes::kRotation + k), v.x,
               fma(value(Boxes::kRotation + 3 + k), v.y, value(Boxes::kRotation + 6 + k) * v.z));
  };
  const Float zero = splat(0.0f), one = splat(1.0f), half = splat(0.5f);
  Float local[3], normal[3], away[3];  // `away`: from the nearest point of the box
  for (int k = 0; k < 3; ++k) {
    local[k] = turned(p, k) + value(Boxes::kOrigin + k);
    normal[k] = turned(n, k);
    away[k] = local[k] - min(max(local[k], -value(Boxes::kHalf + k)), value(Boxes::kHalf + k));
  }
  const Float square = fma(away[0], away[0], fma(away[1], away[1], away[2] * away[2]));
  const Float scale = value(Boxes::kFade);
  Hidden out{zero, {zero, zero, -one}};
  if (type == mjGEOM_PLANE) {
    const Mask over = lanes & (zero < away[2]) & (max(abs(away[0]), abs(away[1])) < splat(1e-6f));
    out.part = select(over, fma(normal[2], -half, half) * fade(square, scale), zero);
    return out;
  }
  if (type == mjGEOM_BOX) {
    const float sizes[3] = {boxes.row(Boxes::kHalf)[i], boxes.row(Boxes::kHalf + 1)[i],
                            boxes.row(Boxes::kHalf + 2)[i]};
    const Float near = fade(square, scale);
    const Float d = max(length_of(square), splat(kNearest));
    Float top = zero;
    for (int k = 0; k < 3; ++k)
      top = top + fma(abs(normal[k]), value(Boxes::kHalf + k), -(normal[k] * local[k]));
    if (!any(lanes & may_hide(d, top, area_above(d, top, value(Boxes::kArea)), near))) return out;
    out = SeenBox(sizes, local, normal).hidden();
    out.part = out.part * near;
  } else {
    const Float radius = value(Boxes::kRadius);
    const Float closeness = inverse_sqrt(max(square, splat(1e-12f)));
    const Float gap = max(fma(square, closeness, -radius), zero);
    // Within the sphere the shape is not known: it hides less and less, and nothing in its middle.
    Float size = radius * closeness;
    const Mask within = one < size;
    if (any(within)) size = select(within, one / size, size);
    out.toward = {-away[0] * closeness, -away[1] * closeness, -away[2] * closeness};
    const Float along =
        fma(out.toward.x, normal[0], fma(out.toward.y, normal[1], out.toward.z * normal[2]));
    out.part = above_horizon(size, along) * fade(gap * gap, scale);
  }
  out.part = select(lanes, max(out.part - splat(kLeastHidden), zero), zero);
  return out;
}

inline Patch patch_of(const Surfaces& s, std::uint32_t lanes) {
  Patch out;
  const int first = __builtin_ctz(lanes);
  for (int c = 0; c < 3; ++c) {
    out.center[c] = s.p[c][first];
    out.normal[c] = s.n[c][first];
  }
  Float away = splat(0.0f), depth = splat(0.0f), bend = splat(0.0f);
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f p = load3(s.p, k) - splat(out.center), n = load3(s.n, k) - splat(out.normal);
    const Mask those = mask_of(lanes >> k & kAllLanes);
    away = max(away, select(those, dot(p, p), splat(0.0f)));
    depth = max(depth, select(those, -dot(p, splat(out.normal)), splat(0.0f)));
    bend = max(bend, select(those, dot(n, n), splat(0.0f)));
  }
  out.radius = std::sqrt(lane_max(away));
  out.depth = lane_max(depth);
  out.bend = std::sqrt(lane_max(bend));
  return out;
}

// The part of the environment that points of surfaces see, and the geoms that hide the rest.
struct alignas(64) Openness {
  float visible[kLanes];  // part of the environment, 0..1
  // Sums over the geoms that hide the environment, weighted by the parts that they hide: 1, their direction
  // in the camera's frame, and their colour.
  float weight[kLanes], toward[3][kLanes], color[3][kLanes];

  Openness() {
    for (int k = 0; k < kLanes; k += kWidth) {
      store(visible + k, splat(1.0f));
      store(weight + k, splat(0.0f));
      for (int c = 0; c < 3; ++c) {
        store(toward[c] + k, splat(0.0f));
        store(color[c] + k, splat(0.0f));
      }
    }
  }

  // Adds what occluder i hides from lanes k .. k + kWidth - 1.
  void add(const OccluderBoxes& boxes, int i, int k, const Hidden& hidden) {
    using Boxes = OccluderBoxes;
    const Float part = hidden.part;
    store(visible + k, load(visible + k) * (splat(1.0f) - min(part, splat(1.0f))));
    store(weight + k, load(weight + k) + part);
    for (int c = 0; c < 3; ++c) {
      const auto value = [&](int row) { return splat(boxes.row(row)[i]); };
      const int row = Boxes::kRotation + 3 * c;
      const Float along =
          fma(value(row), hidden.toward.x,
              fma(value(row + 1), hidden.toward.y, value(row + 2) * hidden.toward.z));
      store(toward[c] + k, fma(part, along, load(toward[c] + k)));
      store(color[c] + k, fma(part, value(Boxes::kColor + c), load(color[c] + k)));
    }
  }
};

// Adds what the geoms near a tile hide from the points of `lanes`.
inline void find_openness(const View& view, const Occluders& tile, const Surfaces& s,
                          const Hits& hits, std::uint32_t lanes, Openness& out) {
  if (!lanes) return;
  const Patch patch = patch_of(s, lanes);
  for (int first = 0; first < tile.count; first += kWidth) {
    for (std::uint32_t near = occluders_near<true>(tile.boxes, first, patch); near;
         near &= near - 1) {
      const int i = first + __builtin_ctz(near);
      if (i >= tile.count) return;
      const int g = tile.list[i], type = view.geoms[g].type;
      for (int k = 0; k < kLanes; k += kWidth) {
        const Mask other = mask_of(lanes >> k & kAllLanes) & ~(load(hits.geom + k) == int_of(g));
        if (!any(other)) continue;
        const Hidden hidden = hidden_by(tile.boxes, i, type, other, load3(s.p, k), load3(s.n, k));
        if (any(splat(0.0f) < hidden.part)) out.add(tile.boxes, i, k, hidden);
      }
    }
  }
}

}  // namespace
}  // namespace mjsense::render
