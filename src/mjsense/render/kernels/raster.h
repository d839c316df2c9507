// SPDX-License-Identifier: Apache-2.0
#pragma once
// Rasterises triangles into a tile. Used if the tile has more pixels than the geom has triangles:
// each triangle is set up once per tile instead of being intersected by every packet of rays. Part
// of the tile kernels.
//
// Let c0 c1 c2 be the corners in the camera's frame. The ray d = (x, y, -1) of a pixel passes
// inside the edge from c1 to c2 if d . (c2 - c1) x (c2 + c1) >= 0 (Pluecker's test). This is a
// linear function of x and y and exactly the negative of that of the neighbour across the edge, so
// there are no gaps between triangles. 1 / t is linear too: d . N / (c0 . N) with N = (c1 - c0) x
// (c2 - c0).

#include "mjsense/render/kernels/trace.h"

namespace mjsense::render {
namespace {

// A block of triangles as linear functions of x and y: f(x, y) = f[0] x + f[1] y - f[2].
struct alignas(64) Drawn {
  float edges[3][3][rays::kClusterSize];
  float inverse_t[3][rays::kClusterSize];
  float window[4][rays::kClusterSize];
  float nearest[rays::kClusterSize], farthest[rays::kClusterSize];  // planar depth of the corners
};

inline void store(float (*p)[rays::kClusterSize], int k, Vec3f v) {
  store(p[0] + k, v.x);
  store(p[1] + k, v.y);
  store(p[2] + k, v.z);
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

// Sets up the triangles that may be visible in the tile: they face the camera and cover a pixel
// centre. `side`: see handedness().
inline std::uint32_t set_up(const View& view, const ViewGeom& g, float side,
                            const rays::TriangleBlock& block, const Tile& tile, Drawn& out) {
  const PixelGrid& grid = view.grid;
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
    shown = shown & (low[0] <= splat(tile.around[1])) & (splat(tile.around[0]) <= high[0]) &
            (low[1] <= splat(tile.around[3])) & (splat(tile.around[2]) <= high[1]) &
            (splat(0.0f) < farthest);
    if (!grid.distorted_rays && tile.regular) {
      const Mask over = holds_center(low[0], high[0], tile.around[0], grid.dx) &
                        holds_center(low[1], high[1], tile.around[3], grid.dy);
      shown = shown & (over | ~ahead);
    }
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
    store(out.nearest + k, nearest);
    store(out.farthest + k, farthest);
  }
  return drawn;
}

inline Float linear(const float (*f)[rays::kClusterSize], int lane, Float x, Float y) {
  return fma(splat(f[0][lane]), x, fma(splat(f[1][lane]), y, splat(-f[2][lane])));
}

// A triangle of a block (`lane`) and a packet that it may cover.
struct Pair {
  std::uint8_t lane, packet;
};

// Whether the triangle covers a pixel of the packet.
inline bool covers(const Drawn& drawn, Pair pair, const Tile& tile) {
  const Pixels& pixels = tile.pixels[pair.packet];
  std::uint32_t inside = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Float x = load(pixels.x + k), y = load(pixels.y + k), zero = splat(0.0f);
    inside |= bits((zero <= linear(drawn.edges[0], pair.lane, x, y)) &
                   (zero <= linear(drawn.edges[1], pair.lane, x, y)) &
                   (zero <= linear(drawn.edges[2], pair.lane, x, y)));
  }
  return inside != 0;
}

// Writes triangle `lane` of the block to the hits of those lanes of a packet where it is the
// nearest so far. Returns whether there are any.
inline bool draw(const ViewGeom& g, int index, const Drawn& drawn, int lane, int face, bool shaded,
                 const Pixels& pixels, Hits& h) {
  bool changed = false;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Float x = load(pixels.x + k), y = load(pixels.y + k), zero = splat(0.0f);
    const Float e0 = linear(drawn.edges[0], lane, x, y), e1 = linear(drawn.edges[1], lane, x, y),
                e2 = linear(drawn.edges[2], lane, x, y);
    const Mask inside = (zero <= e0) & (zero <= e1) & (zero <= e2);
    if (!any(inside)) continue;
    // If the triangle is seen almost edge-on, rounding may move t outside of it.
    const Float t =
        min(max(splat(1.0f) / linear(drawn.inverse_t, lane, x, y), splat(drawn.nearest[lane])),
            splat(drawn.farthest[lane]));
    const Int id_before = load(h.id + k);
    const Float before = load(h.t + k);
    const Mask hit =
        inside & shows(t, int_of(g.id), before, id_before) & (load(pixels.near + k) < t);
    if (!any(hit)) continue;
    changed = true;
    store(h.id + k, select(hit, int_of(g.id), id_before));
    store(h.t + k, select(hit, t, before));
    store(h.geom + k, select(hit, int_of(index), load(h.geom + k)));
    if (!shaded) continue;
    const Float inverse = splat(1.0f) / max(e0 + e1 + e2, splat(1e-30f));
    store(h.prim + k, select(hit, int_of(face), load(h.prim + k)));
    store(h.u + k, select(hit, e1 * inverse, load(h.u + k)));
    store(h.v + k, select(hit, e2 * inverse, load(h.v + k)));
    if (g.mesh) continue;  // the mesh has vertex normals
    const Vec3f n =
        to_geom(g.rot, {splat(-drawn.inverse_t[0][lane]), splat(-drawn.inverse_t[1][lane]),
                        splat(-drawn.inverse_t[2][lane])});
    store(h.n[0] + k, select(hit, n.x, load(h.n[0] + k)));
    store(h.n[1] + k, select(hit, n.y, load(h.n[1] + k)));
    store(h.n[2] + k, select(hit, n.z, load(h.n[2] + k)));
  }
  return changed;
}

// Half-spaces a . q + b >= 0 in the geom's frame; their intersection contains everything the tile
// can see.
struct TileFrustum {
  static constexpr int kPlanes = 5;
  float a[kPlanes][3], size[kPlanes][3], b[kPlanes];
  const float* eye;

  TileFrustum(const ViewGeom& g, const Tile& tile) : eye(g.eye) {
    const float* w = tile.around;
    const float normals[kPlanes][3] = {
        {1, 0, w[0]}, {-1, 0, -w[1]}, {0, 1, w[2]}, {0, -1, -w[3]}, {0, 0, 1}};
    for (int p = 0; p < kPlanes; ++p) {
      const float* n = normals[p];
      b[p] = n[0] * g.pos[0] + n[1] * g.pos[1] + n[2] * g.pos[2];
      for (int i = 0; i < 3; ++i) {
        a[p][i] = n[0] * g.rot[i] + n[1] * g.rot[3 + i] + n[2] * g.rot[6 + i];
        size[p][i] = a[p][i] < 0 ? -a[p][i] : a[p][i];
      }
      const float reach = g.pos[0] * g.pos[0] + g.pos[1] * g.pos[1] + g.pos[2] * g.pos[2];
      b[p] += 1e-6f * (g.radius + __builtin_sqrtf(reach));  // rounding
    }
    b[4] += tile.depth;  // excludes what is behind the hits so far
  }

  std::uint32_t children(const rays::ClusterNode& node) const {
    std::uint32_t seen = 0;
    for (int k = 0; k < rays::kClusterSize; k += kWidth) {
      const Vec3f c{load(node.center[0] + k), load(node.center[1] + k), load(node.center[2] + k)};
      const Vec3f h{load(node.half[0] + k), load(node.half[1] + k), load(node.half[2] + k)};
      Float minimum = splat(kInfinity);
      for (int p = 0; p < kPlanes; ++p)
        minimum = min(minimum, dot(splat(a[p]), c) + fma(splat(size[p][0]), h.x, splat(b[p])) +
                                   fma(splat(size[p][1]), h.y, splat(size[p][2]) * h.z));
      const Vec3f d = c - splat(eye);
      const Vec3f axis{load(node.axis[0] + k), load(node.axis[1] + k), load(node.axis[2] + k)};
      const Float away = fma(load(node.spread + k), sqrt(dot(d, d)), sqrt(dot(h, h)));
      seen |= bits((splat(0.0f) <= minimum) & (dot(axis, d) <= away)) << k;
    }
    return seen & ((1u << node.count) - 1);
  }
};

constexpr int kMaxBlocks = 640;  // in one tile; more are never worth rasterising

// Writes the blocks of triangles that the tile may see and returns their number, or -1 if it
// exceeds `maximum`.
inline int find_blocks(const rays::Clusters& clusters, const TileFrustum& frustum, int maximum,
                       int* blocks) {
  int waiting[rays::Clusters::kMaxWaiting];
  int left = 1, found = 0;
  waiting[0] = 0;
  while (left) {
    const rays::ClusterNode& node = clusters.nodes[waiting[--left]];
    for (std::uint32_t seen = frustum.children(node); seen; seen &= seen - 1) {
      const int child = node.child[__builtin_ctz(seen)];
      if (child >= 0) {
        waiting[left++] = child;
      } else if (found < maximum) {
        blocks[found++] = ~child;
      } else {
        return -1;
      }
    }
  }
  return found;
}

inline void prefetch(const rays::TriangleBlock& block) {
  const char* p = reinterpret_cast<const char*>(&block);
  for (std::size_t line = 0; line < sizeof block; line += 64) __builtin_prefetch(p + line);
}

// Writes the triangles of `lanes` and the packets that they cover, in order, and returns the number of
// such pairs. Few triangles cover a pixel of a packet that is in their reach, which the CPU could
// not predict; therefore no step depends on it.
inline int find_covered(const Drawn& drawn, std::uint32_t lanes, PacketMask packets,
                        const Tile& tile, Pair* out) {
  constexpr int kAtOnce = 64 / kTilePackets;  // triangles whose packets fit into a word
  int count = 0;
  while (lanes) {
    std::uint64_t reach = 0;
    std::uint8_t lane_of[kAtOnce];
    for (int i = 0; i < kAtOnce && lanes; ++i, lanes &= lanes - 1) {
      const int lane = lane_of[i] = static_cast<std::uint8_t>(__builtin_ctz(lanes));
      const float window[4] = {drawn.window[0][lane], drawn.window[1][lane], drawn.window[2][lane],
                               drawn.window[3][lane]};
      // Triangles that coincide with earlier hits are in reach too; shows() decides.
      const float nearest = drawn.nearest[lane] * (1 - 2 * kSame);
      reach |= static_cast<std::uint64_t>(packets & packets_in_reach(window, nearest, tile))
               << (i * kTilePackets);
    }
    for (; reach; reach &= reach - 1) {
      const int bit = __builtin_ctzll(reach);
      out[count] = {lane_of[bit / kTilePackets], static_cast<std::uint8_t>(bit % kTilePackets)};
      count += covers(drawn, out[count], tile);
    }
  }
  return count;
}

// Rasterises geom `index` into `packets` of the tile if that is cheaper than casting rays. Returns
// false if it is not.
inline bool rasterize(const View& view, int index, PacketMask packets, Tile& tile,
                      PacketMask& changed) {
  const ViewGeom& g = view.geoms[index];
  const rays::Clusters& clusters = *g.clusters;
  // A packet of rays costs about as much as kBlocksPerPacket blocks.
  constexpr int kBlocksPerPacket = 40;
  const int maximum = kBlocksPerPacket * __builtin_popcount(packets);
  int blocks[kMaxBlocks];
  const int count = find_blocks(clusters, TileFrustum(g, tile), maximum, blocks);
  if (count < 0) return false;
  const float side = handedness(g);
  Drawn drawn;
  Pair pairs[rays::kClusterSize * kTilePackets + 1];
  for (int i = 0; i < count; ++i) {
    const rays::TriangleBlock& block = clusters.blocks[blocks[i]];
    if (i + 1 < count) prefetch(clusters.blocks[blocks[i + 1]]);
    const std::uint32_t lanes = set_up(view, g, side, block, tile, drawn);
    const int covered = find_covered(drawn, lanes, packets, tile, pairs);
    for (int k = 0; k < covered; ++k) {
      const auto [lane, q] = pairs[k];
      if (draw(g, index, drawn, lane, block.face[lane], tile.shaded, tile.pixels[q], tile.hits[q]))
        changed |= 1u << q;
    }
  }
  return true;
}

}  // namespace
}  // namespace mjsense::render
