// SPDX-License-Identifier: Apache-2.0
#pragma once
// Computes horizons: which shadow rays leave the mesh on which they start for good. Part of the
// tile kernels.
//
// Consider a face with unit normal N. Let h(x) be the height of a point above the face's plane, and
// e(x) its distance beyond a line in that plane that has the whole face on one side: a line along
// an edge or through a corner. For another triangle, if the part of it that rises is beyond the
// line, h / e is largest at one of its corners, because it is a quotient of linear functions. The
// minimum over the lines bounds the slope at which the triangle rises as seen from the face. The
// maximum over all triangles is the face's horizon. It is computed per octant of directions.
// Triangles that lie entirely behind the face along one of the octant's axes are left out: each
// octant has three planes, perpendicular to the axes, where the face ends.

#include <utility>

#include "mjsense/rays/horizons.h"
#include "mjsense/render/kernels/mesh_parts.h"
#include "mjsense/render/kernels/rays.h"

namespace mjsense::render {
namespace {

// Maximum slope of a horizon; steeper ones are treated as walls. See leaves_mesh().
constexpr float kSteepest = 1.2f;
// Relative to the mesh's size. Smaller heights do not count as a rise, and a corner that is beyond
// an edge by less counts as on it.
constexpr float kFlat = 1e-6f;
// Relative to the mesh's size. Rays that start higher above their face are always cast.
constexpr float kMaxLift = 3e-3f;

// A face as the origin of a horizon; all coordinates are relative to its first corner.
struct FaceHorizon {
  static constexpr int kLines = 6;  // three along the edges, three through the corners
  float origin[3], normal[3];
  float sides[2][3];                   // vectors to the other corners
  float out[kLines][3], line[kLines];  // e(x) = out . x - line
  float sign[3], end[3];               // a point is ahead if sign * x >= end on every axis
  float flat;                          // m, minimum height of a rise
  bool valid;

  FaceHorizon(const rays::TriangleBlock& block, int lane, int octant, float size)
      : flat(kFlat * size) {
    float c[3][3];
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) c[i][k] = block.corners[i][k][lane];
    const auto cross = [](const float* a, const float* b, float* out) {
      for (int k = 0; k < 3; ++k) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        out[k] = a[i] * b[j] - a[j] * b[i];
      }
    };
    const auto make_unit = [](float* v) {
      const float length = __builtin_sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
      for (int k = 0; k < 3; ++k) v[k] /= length;
      return length > 0;
    };
    float side[3][3];
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) side[i][k] = c[(i + 1) % 3][k] - c[i][k];
    cross(side[0], side[1], normal);
    valid = make_unit(normal);
    for (int i = 0; i < 3; ++i) {
      cross(side[i], normal, out[i]);
      valid = make_unit(out[i]) && valid;
    }
    for (int i = 0; i < 3; ++i) {  // line through the corner where edge i starts
      for (int k = 0; k < 3; ++k) out[3 + i][k] = out[i][k] + out[(i + 2) % 3][k];
      valid = make_unit(out[3 + i]) && valid;
    }
    for (int i = 0; i < kLines; ++i) {
      line[i] = 0;
      for (int k = 0; k < 3; ++k) line[i] += out[i][k] * (c[i % 3][k] - c[0][k]);
    }
    for (int k = 0; k < 3; ++k) {
      origin[k] = c[0][k];
      for (int i = 0; i < 2; ++i) sides[i][k] = c[i + 1][k] - c[0][k];
      sign[k] = octant >> k & 1 ? -1.0f : 1.0f;
      end[k] = 0;
      for (auto& to : sides) end[k] = sign[k] * to[k] < end[k] ? sign[k] * to[k] : end[k];
      end[k] -= 1.5f * kMaxLift * size;
    }
  }

  // Lanes whose box (center x, half sizes `half`) is at least partly ahead.
  Mask ahead(Vec3f x, Vec3f half) const {
    return (splat(end[0]) <= fma(splat(sign[0]), x.x, half.x)) &
           (splat(end[1]) <= fma(splat(sign[1]), x.y, half.y)) &
           (splat(end[2]) <= fma(splat(sign[2]), x.z, half.z));
  }
};

// Children of a node that may contain a rise steeper than `slope`.
inline std::uint32_t rising(const FaceHorizon& from, const rays::ClusterNode& node, float slope) {
  std::uint32_t out = 0;
  for (int k = 0; k < rays::kClusterSize; k += kWidth) {
    const Vec3f half{load(node.half[0] + k), load(node.half[1] + k), load(node.half[2] + k)};
    const Vec3f center =
        Vec3f{load(node.center[0] + k), load(node.center[1] + k), load(node.center[2] + k)} -
        splat(from.origin);
    const auto reach = [&](const float* n) {
      return fma(abs(splat(n[0])), half.x,
                 fma(abs(splat(n[1])), half.y, abs(splat(n[2])) * half.z));
    };
    const Float top = dot(splat(from.normal), center) + reach(from.normal);
    Float away = splat(0.0f);
    for (int i = 0; i < FaceHorizon::kLines; ++i)
      away = max(away, dot(splat(from.out[i]), center) - reach(from.out[i]) - splat(from.line[i]));
    out |= bits((splat(from.flat) < top) & (splat(slope) * away < top) & from.ahead(center, half))
           << k;
  }
  return out & ((1u << node.count) - 1);
}

// The line that the block is farthest beyond, judged by the block's first corner.
inline int farthest_line(const FaceHorizon& from, const rays::TriangleBlock& block) {
  int best = 0;
  float maximum = -kInfinity;
  for (int i = 0; i < FaceHorizon::kLines; ++i) {
    float e = -from.line[i];
    for (int k = 0; k < 3; ++k) e += from.out[i][k] * (block.corners[0][k][0] - from.origin[k]);
    if (e > maximum) best = i;
    maximum = e > maximum ? e : maximum;
  }
  return best;
}

// The steepest slope among the triangles of a block, but at least `slope`. Infinity if a triangle
// is not beyond any line.
inline float steepest_of(const FaceHorizon& from, const rays::TriangleBlock& block, float slope) {
  const Float zero = splat(0.0f), flat = splat(from.flat), endless = splat(kInfinity);
  const int first = farthest_line(from, block);
  Float maximum = splat(slope);
  for (int k = 0; k < rays::kClusterSize; k += kWidth) {
    Vec3f x[3];
    Float h[3];
    Mask tall[3];
    for (int j = 0; j < 3; ++j) {
      x[j] = Vec3f{load(block.corners[j][0] + k), load(block.corners[j][1] + k),
                   load(block.corners[j][2] + k)} -
             splat(from.origin);
      h[j] = dot(splat(from.normal), x[j]);
      tall[j] = flat < h[j];
    }
    const auto box = [](Float a, Float b, Float c) {
      const Float minimum = min(a, min(b, c)), maximum = max(a, max(b, c));
      return std::pair{splat(0.5f) * (minimum + maximum), splat(0.5f) * (maximum - minimum)};
    };
    const auto [mx, hx] = box(x[0].x, x[1].x, x[2].x);
    const auto [my, hy] = box(x[0].y, x[1].y, x[2].y);
    const auto [mz, hz] = box(x[0].z, x[1].z, x[2].z);
    const Mask rises = (tall[0] | tall[1] | tall[2]) & from.ahead({mx, my, mz}, {hx, hy, hz});
    if (!any(rises)) continue;
    Mask crosses[3];  // whether the side to the next corner passes the height `flat`
    Float at[3];      // position along the side, 0..1
    for (int j = 0; j < 3; ++j) {
      const int n = (j + 1) % 3;
      crosses[j] = (tall[j] & ~tall[n]) | (tall[n] & ~tall[j]);
      at[j] = (flat - h[j]) / (h[n] - h[j]);
    }
    Float minimum = endless;
    const auto include_rise = [&](Vec3f out, Float line) {
      Float e[3], rise = zero;
      for (int j = 0; j < 3; ++j) e[j] = dot(out, x[j]) - line;
      for (int j = 0; j < 3; ++j) {
        const Float here = select(zero < e[j], h[j] / e[j], endless);
        rise = max(rise, select(tall[j], here, zero));
        const Float begins = fma(at[j], e[(j + 1) % 3] - e[j], e[j]);
        rise = select(crosses[j] & (begins < -flat), endless, rise);
      }
      minimum = min(minimum, rise);
    };
    for (int n = 0; n < FaceHorizon::kLines && any(rises & (maximum < minimum)); ++n) {
      const int i = (first + n) % FaceHorizon::kLines;
      include_rise(splat(from.out[i]), splat(from.line[i]));
    }
    // Try a line parallel to the triangle's intersection with the face's plane.
    if (any(rises & (maximum < minimum))) {
      const Vec3f n = cross(x[1] - x[0], x[2] - x[0]), up = splat(from.normal);
      Vec3f out = along(n, -dot(n, up), up);
      const Float away = dot(out, x[0]) + dot(out, x[1]) + dot(out, x[2]);
      const Float size = dot(out, out);
      // False if the triangle is nearly parallel to the face.
      const Mask known = splat(1e-6f) * dot(n, n) < size;
      const Float sign =
          select(known, select(away < zero, splat(-1.0f), splat(1.0f)) / sqrt(size), zero);
      out = {sign * out.x, sign * out.y, sign * out.z};
      const Float line =
          max(zero, max(dot(out, splat(from.sides[0])), dot(out, splat(from.sides[1]))));
      include_rise(out, line);
    }
    maximum = max(maximum, select(rises, minimum, zero));
  }
  return lane_max(maximum);
}

// Computes the value for Horizons::ask().
inline float find_horizon(const rays::Clusters& clusters, int slot, int octant, float size) {
  const FaceHorizon from(clusters.blocks[slot / rays::kClusterSize], slot % rays::kClusterSize,
                         octant, size);
  if (!from.valid) return rays::Horizons::kNever;
  int waiting[rays::Clusters::kMaxWaiting];
  int left = 1;
  waiting[0] = 0;
  // The face's own block first: steep neighbours exclude much of the tree.
  float slope = steepest_of(from, clusters.blocks[slot / rays::kClusterSize], 0);
  if (slope > kSteepest) return rays::Horizons::kNever;
  while (left) {
    const rays::ClusterNode& node = clusters.nodes[waiting[--left]];
    for (std::uint32_t near = rising(from, node, slope); near; near &= near - 1) {
      const int child = node.child[__builtin_ctz(near)];
      if (child >= 0) {
        waiting[left++] = child;
        continue;
      }
      slope = steepest_of(from, clusters.blocks[~child], slope);
      if (slope > kSteepest) return rays::Horizons::kNever;
    }
  }
  return slope / __builtin_sqrtf(1 + slope * slope) + 2e-3f;
}

// Lanes of `own` whose rays do not hit the mesh of `g` again. The rays start on the mesh's faces,
// at `foot`, lifted by `lift` (m) along `normal`, and go in direction d; geom frame.
//
// Let q be the maximum distance of the point from the face, L the lift, and c and s the cosine and
// sine of the angle between the two normals. The ray starts at a height of at least L c - q above
// the face and at a lateral distance of at most L s + q / facing, where `facing` is the cosine of
// the angle between the viewing ray and the face's normal. So it starts above everything that rises
// with a slope of at most (L c - q) / (L s + q / facing), which is 1.3 for the limits used below.
// In total it starts at most 1.5 L from the face, so geometry that is not ahead in the ray's octant
// stays behind it.
inline Mask leaves_mesh(const ViewGeom& g, const int* faces, Vec3f foot, Vec3f normal, Vec3f d,
                        Float lift, Mask own) {
  own = own & (lift <= splat(kMaxLift * g.radius));
  const std::uint32_t asked = bits(own);
  if (!asked) return own;
  alignas(64) int octants[kWidth];
  const auto bit = [](Float x, int i) {
    return select(x < splat(0.0f), int_of(1 << i), int_of(0));
  };
  store(octants, bit(d.x, 0) + bit(d.y, 1) + bit(d.z, 2));
  // The sines also go through columns(): loading a vector right after storing its elements would
  // stall on store forwarding.
  Float4 planes[kWidth], sines[kWidth];
  const rays::Horizons& horizons = horizons_of(g);
  for (int i = 0; i < kWidth; ++i) {
    planes[i] = Float4{};
    sines[i] = Float4{rays::Horizons::kNever};
    if (!(asked >> i & 1u) || faces[i] < 0) continue;  // or a wall of a height field
    planes[i] = load4(horizons.plane(faces[i]));
    sines[i] = Float4{horizons.ask(faces[i], octants[i], [&] {
      return find_horizon(clusters_of(g), horizons.slot(faces[i]), octants[i], g.radius);
    })};
  }
  const Vec4f plane = columns(planes);
  const Vec3f n{plane.x, plane.y, plane.z};
  const Float sine = columns(sines).x, rise = dot(d, n);
  const Mask steep = (splat(0.0f) < rise) & (dot(d, d) * (sine * sine) < rise * rise);
  if (!any(own & steep)) return mask_of(0);
  const Vec3f from = splat(g.eye) - foot;
  const Float facing = dot(from, n) / sqrt(dot(from, from));
  const Float away = abs(dot(foot, n) - plane.w), allowed = lift * splat(0.05f);
  return own & steep & (splat(0.9f) < dot(normal, n)) &
         (away < allowed * min(splat(1.0f), splat(4.0f) * facing));
}

}  // namespace
}  // namespace mjsense::render
