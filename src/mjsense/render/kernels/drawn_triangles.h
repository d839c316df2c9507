// SPDX-License-Identifier: Apache-2.0
#pragma once
// Triangles that are set up to be rasterised into a tile. Part of the tile kernels.
//
// Let c0 c1 c2 be the corners in the camera's frame. The ray d = (x, y, -1) of a pixel passes
// inside the edge from c1 to c2 if d . (c2 - c1) x (c2 + c1) >= 0 (Pluecker's test). This is a
// linear function of x and y and exactly the negative of that of the neighbour across the edge, so
// there are no gaps between triangles. 1 / t is linear too: d . N / (c0 . N) with N = (c1 - c0) x
// (c2 - c0).

#include "mjsense/render/kernels/trace.h"

namespace mjsense::render {
namespace {

// A block of triangles as linear functions of x and y: f(x, y) = f[0] x + f[1] y + f[2].
struct alignas(64) Drawn {
  float edges[3][3][rays::kClusterSize];
  float inverse_t[3][rays::kClusterSize];
  float window[4][rays::kClusterSize];
  float nearest[rays::kClusterSize], farthest[rays::kClusterSize];  // planar depth of the corners
  int face[rays::kClusterSize];
};

// Stores v . (x, y, -1) as a function of x and y.
inline void store(float (*p)[rays::kClusterSize], int k, Vec3f v) {
  store(p[0] + k, v.x);
  store(p[1] + k, v.y);
  store(p[2] + k, -v.z);
}

inline Vec3f scaled(Vec3f v, float by) {
  return {v.x * splat(by), v.y * splat(by), v.z * splat(by)};
}

// Lanes where the interval [low, high] contains a pixel centre first + i * step.
inline Mask holds_center(Float low, Float high, float first, float step) {
  constexpr float kSlack = 1e-3f;  // pixels
  const Float inverse = splat(1.0f / step);
  const Float a = (low - splat(first)) * inverse, b = (high - splat(first)) * inverse;
  return -floor(-(min(a, b) - splat(kSlack))) <= floor(max(a, b) + splat(kSlack));
}

// 1, or -1 if the camera's frame is left-handed, as that of a mirrored camera.
inline float handedness(const ViewGeom& g) {
  const float* r = g.rot;
  const float determinant = r[0] * (r[4] * r[8] - r[5] * r[7]) -
                            r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]);
  return determinant < 0 ? -1.0f : 1.0f;
}

// Lanes whose triangles may cover the centre of one of the tile's pixels, which are on the grid.
inline Mask over_centers(const PixelGrid& grid, const Tile& tile, const Float* low,
                         const Float* high) {
  return holds_center(low[0], high[0], tile.around[0], grid.dx) &
         holds_center(low[1], high[1], tile.around[3], grid.dy);
}

inline Mask overlap(const Float* low, const Float* high, const float* window) {
  return (low[0] <= splat(window[1])) & (splat(window[0]) <= high[0]) &
         (low[1] <= splat(window[3])) & (splat(window[2]) <= high[1]);
}

// Sets up the triangles that face the camera and overlap `window`. `centers`: if not null, only those
// that may cover the centre of one of this tile's pixels. `side`: see handedness().
inline std::uint32_t set_up(const View& view, const ViewGeom& g, float side,
                            const rays::TriangleBlock& block, const float* window,
                            const Tile* centers, Drawn& out) {
  std::uint32_t drawn = 0;
  for (int k = 0; k < rays::kClusterSize; k += kWidth) {
    Vec3f c[3];
    for (int i = 0; i < 3; ++i) {
      const Vec3f v{load(block.corners[i][0] + k), load(block.corners[i][1] + k),
                    load(block.corners[i][2] + k)};
      c[i] = splat(g.pos) + from_geom(g.rot, v);
    }
    const Vec3f n = scaled(cross(c[1] - c[0], c[2] - c[0]), side);
    const Float volume = dot(n, c[0]);
    Mask shown = volume < splat(-1e-30f);
    if (!any(shown)) continue;
    const Float nearest = -max(c[0].z, max(c[1].z, c[2].z));
    const Float farthest = -min(c[0].z, min(c[1].z, c[2].z));
    const Mask ahead = splat(kTiny) < nearest;
    Float low[2], high[2], inverse_z[3];
    for (int i = 0; i < 3; ++i) inverse_z[i] = splat(-1.0f) / c[i].z;
    for (int axis = 0; axis < 2; ++axis) {
      Float x[3];
      for (int i = 0; i < 3; ++i) x[i] = (axis == 0 ? c[i].x : c[i].y) * inverse_z[i];
      const Float a = min(x[0], min(x[1], x[2])), b = max(x[0], max(x[1], x[2]));
      const Float slack = splat(1e-6f) * (splat(1.0f) + max(abs(a), abs(b)));
      low[axis] = select(ahead, a - slack, splat(-kInfinity));
      high[axis] = select(ahead, b + slack, splat(kInfinity));
    }
    shown = shown & overlap(low, high, window) & (splat(0.0f) < farthest);
    if (centers) shown = shown & (over_centers(view.grid, *centers, low, high) | ~ahead);
    const std::uint32_t lanes = bits(shown);
    if (!lanes) continue;
    drawn |= lanes << k;
    for (int i = 0; i < 3; ++i) {
      const Vec3f a = c[(i + 1) % 3], b = c[(i + 2) % 3];
      store(out.edges[i], k, scaled(cross(b - a, b + a), side));
    }
    const Float inverse = splat(1.0f) / volume;
    store(out.inverse_t, k, {n.x * inverse, n.y * inverse, n.z * inverse});
    for (int axis = 0; axis < 2; ++axis) {
      store(out.window[2 * axis] + k, low[axis]);
      store(out.window[2 * axis + 1] + k, high[axis]);
    }
    store(out.face + k, load(block.face + k));
    store(out.nearest + k, nearest);
    store(out.farthest + k, farthest);
  }
  return drawn;
}

// Blocks that were set up for a tile, kept for samples of its pixels at other places.
class KeptTriangles {
 public:
  struct OfGeom {
    int index;        // in the view
    int first, last;  // blocks
  };

  void clear() { count_ = num_geoms_ = 0; }
  // Call begin(), add() for each block that is set up in next(), and end() if begin() returned true.
  // begin(): whether there is room for `blocks` blocks.
  bool begin(int blocks) {
    first_ = count_;
    return count_ + blocks <= kMostBlocks && num_geoms_ < kMostGeoms;
  }
  Drawn& next() { return blocks_[count_]; }
  void add(std::uint32_t lanes) { lanes_[count_++] = lanes; }
  void end(int index) { geoms_[num_geoms_++] = {index, first_, count_}; }

  const OfGeom* find(int index) const {  // null: none are kept
    for (int i = 0; i < num_geoms_; ++i)
      if (geoms_[i].index == index) return &geoms_[i];
    return nullptr;
  }
  const Drawn& block(int i) const { return blocks_[i]; }
  std::uint32_t lanes(int i) const { return lanes_[i]; }  // that were set up

 private:
  static constexpr int kMostBlocks = 512, kMostGeoms = 64;

  Drawn blocks_[kMostBlocks];
  std::uint32_t lanes_[kMostBlocks];
  int count_, first_;
  OfGeom geoms_[kMostGeoms];
  int num_geoms_;
};

// Lanes of a block that was set up whose triangles overlap `window` and, if `centers` is not null, may
// cover the centre of one of this tile's pixels.
inline std::uint32_t lanes_over(const View& view, const Drawn& drawn, const float* window,
                                const Tile* centers) {
  std::uint32_t lanes = 0;
  for (int k = 0; k < rays::kClusterSize; k += kWidth) {
    const Float low[2] = {load(drawn.window[0] + k), load(drawn.window[2] + k)};
    const Float high[2] = {load(drawn.window[1] + k), load(drawn.window[3] + k)};
    Mask over = overlap(low, high, window);
    if (centers) over = over & over_centers(view.grid, *centers, low, high);
    lanes |= bits(over) << k;
  }
  return lanes;
}

}  // namespace
}  // namespace mjsense::render
