// SPDX-License-Identifier: Apache-2.0
#pragma once
// Rasterises triangles into a tile. Used if the tile has more pixels than the geom has triangles:
// each triangle is set up once per tile instead of being intersected by every packet of rays. Part
// of the tile kernels.

#include "mjsense/render/kernels/drawn_triangles.h"
#include "mjsense/render/kernels/trace.h"

namespace mjsense::render {
namespace {

inline Float linear(const float (*f)[rays::kClusterSize], int lane, Float x, Float y) {
  return fma(splat(f[0][lane]), x, fma(splat(f[1][lane]), y, splat(f[2][lane])));
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
    if (g.mesh && g.mesh->normals) continue;
    const Vec3f n =
        to_geom(g.rot, {splat(-drawn.inverse_t[0][lane]), splat(-drawn.inverse_t[1][lane]),
                        splat(drawn.inverse_t[2][lane])});
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

  // `w`: window of the tile's pixels. `depth`: the hits, m; nothing behind it is contained.
  TileFrustum(const ViewGeom& g, const float* w, float depth) : eye(g.eye) {
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
    b[4] += depth;
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

// See MayShow. If it is false, rasterize() draws nothing into a tile within `window`.
inline bool may_show(const ViewGeom& g, const float* window) {
  if (!has_clusters(g)) return true;
  return find_blocks(clusters_of(g), TileFrustum(g, window, kInfinity), 0, nullptr) != 0;
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

// A geom that is drawn into `packets` of a tile.
struct Drawing {
  const ViewGeom& geom;
  int index;  // of the geom in the view
  PacketMask packets;
  Tile& tile;
  PacketMask changed = 0;

  void draw(const Drawn& drawn, std::uint32_t lanes) {
    Pair pairs[rays::kClusterSize * kTilePackets + 1];
    const int covered = find_covered(drawn, lanes, packets, tile, pairs);
    for (int k = 0; k < covered; ++k) {
      const auto [lane, q] = pairs[k];
      if (render::draw(geom, index, drawn, lane, drawn.face[lane], tile.shaded, tile.pixels[q],
                       tile.hits[q]))
        changed |= 1u << q;
    }
  }
};

// Rasterises geom `index` into `packets` of the tile if that is cheaper than casting rays. Returns
// false if it is not.
inline bool rasterize(const View& view, int index, PacketMask packets, Tile& tile,
                      PacketMask& changed) {
  const ViewGeom& g = view.geoms[index];
  Drawing drawing{g, index, packets, tile};
  if (const auto* part = tile.kept ? tile.kept->find(index) : nullptr) {
    for (int i = part->first; i < part->last; ++i) {
      const Drawn& drawn = tile.kept->block(i);
      drawing.draw(drawn, tile.kept->lanes(i) & lanes_over(view, drawn, tile.around, nullptr));
    }
    changed = drawing.changed;
    return true;
  }
  const rays::Clusters& clusters = clusters_of(g);
  // A packet of rays costs about as much as kBlocksPerPacket blocks.
  constexpr int kBlocksPerPacket = 40;
  const int maximum = kBlocksPerPacket * __builtin_popcount(packets);
  int blocks[kMaxBlocks];
  // Samples may see what is behind the centres' hits.
  const TileFrustum frustum =
      tile.keep ? TileFrustum(g, tile.reach, kInfinity) : TileFrustum(g, tile.around, tile.depth);
  const int count = find_blocks(clusters, frustum, maximum, blocks);
  if (count < 0) return false;
  const float side = handedness(g);
  const Tile* centers = tile.regular && !view.grid.distorted_rays ? &tile : nullptr;
  KeptTriangles* const keep = tile.keep && tile.keep->begin(count) ? tile.keep : nullptr;
  Drawn not_kept;
  for (int i = 0; i < count; ++i) {
    const rays::TriangleBlock& block = clusters.blocks[blocks[i]];
    Drawn& drawn = keep ? keep->next() : not_kept;
    if (i + 1 < count) prefetch(clusters.blocks[blocks[i + 1]]);
    std::uint32_t lanes = set_up(view, g, side, block, keep ? tile.reach : tile.around,
                                 keep ? nullptr : centers, drawn);
    if (keep && lanes) {
      keep->add(lanes);
      lanes &= lanes_over(view, drawn, tile.around, centers);
    }
    drawing.draw(drawn, lanes);
  }
  if (keep) keep->end(index);
  changed = drawing.changed;
  return true;
}

}  // namespace
}  // namespace mjsense::render
