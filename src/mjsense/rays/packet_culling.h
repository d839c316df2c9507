// SPDX-License-Identifier: Apache-2.0
#pragma once
// Culls geoms against a packet of rays. The rays of the packet lie in a beam: a box of origins,
// swept along a range of slopes over an axis on which all directions have the same sign. The beam's
// cross-section at each geom's box decides whether the packet can hit it; 4 to 16 geoms are tested
// at a time.

#include "mjsense/core/simd.h"
#include "mjsense/rays/kernels.h"
#include "mjsense/rays/packet.h"
#include "mjsense/rays/ray_geom.h"

namespace mjsense::rays {
namespace {

struct Range {
  float low, high;
};

// Minimum and maximum over the active lanes of several packets.
struct Bound {
  Float low = kNoHit, negated_high = kNoHit;
  void add(Mask active, Float x) {
    low = min(low, select(active, x, Float(kNoHit)));
    negated_high = min(negated_high, select(active, -x, Float(kNoHit)));
  }
  Range range() const { return {lane_min(low), -lane_min(negated_high)}; }
};

struct Beam {
  bool empty = false;       // no lane is active
  bool everywhere = false;  // the directions share no axis; every box is a candidate
  int axis = 0;
  float sign = 1.0f;
  Range origin[3];  // m, world frame
  Range slope[3];   // d[i] / |d[axis]|
  float tmax = 0.0f;

  // All packets must have the same `origin`.
  Beam(const RayPacket* packets, int count) {
    Bound o[3], d[3];
    Float farthest = -1.0f;
    for (int p = 0; p < count; ++p) {
      for (int k = 0; k < kPacket; k += kWidth) {
        const Float t = load(packets[p].tmax + k);
        const Mask active = t >= Float(0.0f);
        farthest = max(farthest, t);
        for (int i = 0; i < 3; ++i) {
          o[i].add(active, load(packets[p].o[i] + k));
          d[i].add(active, load(packets[p].d[i] + k));
        }
      }
    }
    tmax = lane_max(farthest);
    empty = tmax < 0.0f;
    if (empty) return;
    float best = 0.0f;
    for (int i = 0; i < 3; ++i) {
      const Range r = d[i].range(), from = o[i].range();
      const float smallest = r.low > 0 ? r.low : (r.high < 0 ? -r.high : 0.0f);
      if (smallest > best) {
        best = smallest;
        axis = i;
        sign = r.low > 0 ? 1.0f : -1.0f;
      }
      const float center = static_cast<float>(packets->origin[i]);
      const float error = 2e-7f * ((center < 0 ? -center : center) + 1.0f);
      origin[i] = {center + from.low - error, center + from.high + error};
    }
    everywhere = best < 1e-3f;
    if (everywhere) return;
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    Bound slope_b, slope_c;
    for (int p = 0; p < count; ++p) {
      for (int k = 0; k < kPacket; k += kWidth) {
        const Mask active = load(packets[p].tmax + k) >= Float(0.0f);
        const Float inverse = Float(1.0f) / abs(load(packets[p].d[axis] + k));
        slope_b.add(active, load(packets[p].d[b] + k) * inverse);
        slope_c.add(active, load(packets[p].d[c] + k) * inverse);
      }
    }
    slope[b] = slope_b.range();
    slope[c] = slope_c.range();
  }

  // Returns the lanes of boxes i .. i + kWidth - 1 that the beam touches. `nearest` is a lower
  // bound of the distance at which it does.
  Mask touches(const KernelBoxes& boxes, int i, Float& nearest) const {
    const int a = axis, b = (axis + 1) % 3, c = (axis + 2) % 3;
    const Float lo = loadu(boxes.low[a] + i), hi = loadu(boxes.high[a] + i);
    const bool up = sign > 0;
    // Distances along the axis at which the box begins and ends: from the origin nearest to the box
    // and from the one farthest from it.
    const Float begin = max(up ? lo - origin[a].high : Float(origin[a].low) - hi, 0.0f);
    const Float end = up ? hi - origin[a].low : Float(origin[a].high) - lo;
    nearest = begin;
    Mask m = end >= Float(0.0f);
    for (int j : {b, c}) {
      const Float minimum = Float(origin[j].low) + min(begin * slope[j].low, end * slope[j].low);
      const Float maximum = Float(origin[j].high) + max(begin * slope[j].high, end * slope[j].high);
      m = m & (minimum <= loadu(boxes.high[j] + i)) & (maximum >= loadu(boxes.low[j] + i));
    }
    return m & (begin <= Float(tmax));
  }
};

// Calls take(box, nearest) for each box that the beam touches.
template <class Take>
void for_each_box(const Beam& beam, const KernelBoxes& boxes, Take&& take) {
  if (beam.empty) return;
  alignas(64) float nearest[kWidth] = {};
  for (int i = 0; i < boxes.count; i += kWidth) {
    std::uint32_t in = i + kWidth <= boxes.count ? kAllLanes : (1u << (boxes.count - i)) - 1;
    if (!beam.everywhere) {
      Float t;
      in &= bits(beam.touches(boxes, i, t));
      if (in == 0) continue;
      store(nearest, t);
    }
    for (; in != 0; in &= in - 1) {
      const int j = __builtin_ctz(in);
      take(i + j, nearest[j]);
    }
  }
}

inline bool passes(const KernelWorld& world, const KernelFilter& filter, int geom) {
  constexpr std::uint32_t kTransparent = 0x100;  // RayWorld::kTransparent
  const std::uint32_t flags = world.flags[geom];
  if ((flags & filter.groups) == 0 || (!filter.transparent && (flags & kTransparent) != 0))
    return false;
  if (filter.exclude_body >= 0 && world.bodies[geom] == filter.exclude_body) return false;
  return filter.hidden == nullptr || filter.hidden[geom] == 0;
}

// Calls take(geom, nearest) for each geom that the beam touches and that passes the filter. For
// worlds with blocks of geoms; the order of the calls is undefined.
template <class Take>
void for_each_in_blocks(const Beam& beam, const KernelWorld& world, const KernelFilter& filter,
                        Take&& take) {
  const KernelBoxes& all = world.boxes;
  for_each_box(beam, world.blocks, [&](int block, float) {
    const int first = block * KernelWorld::kBlock, left = all.count - first;
    const KernelBoxes part{{all.low[0] + first, all.low[1] + first, all.low[2] + first},
                           {all.high[0] + first, all.high[1] + first, all.high[2] + first},
                           all.ids + first,
                           left < KernelWorld::kBlock ? left : KernelWorld::kBlock};
    for_each_box(beam, part, [&](int i, float nearest) {
      if (passes(world, filter, part.ids[i])) take(part.ids[i], nearest);
    });
  });
}

// Sorts by ascending key. Shellsort, because the counts are small and the input is nearly sorted.
template <class T, class Key>
void sort_by(T* c, int count, Key key) {
  for (int gap = count > 64 ? 31 : count > 12 ? 5 : 1; gap > 0; gap = gap > 5 ? 5 : gap / 5) {
    for (int i = gap; i < count; ++i) {
      const T x = c[i];
      int j = i;
      for (; j >= gap && key(c[j - gap]) > key(x); j -= gap) c[j] = c[j - gap];
      c[j] = x;
    }
  }
}

inline void sort_candidates(RayCandidate* c, int count) {
  sort_by(c, count, [](const RayCandidate& x) { return x.t; });
}

// gather() and cull() for worlds with blocks. Results are sorted by geom id first, so that geoms
// at equal distance come in the same order with and without blocks and the results are equal bit
// for bit.
[[gnu::noinline]] inline int gather_blocks(const KernelWorld& world, const KernelFilter& filter,
                                           const RayPacket& rays, RayCandidate* out) {
  int count = 0;
  for_each_in_blocks(Beam(&rays, 1), world, filter, [&](int i, float nearest) {
    out[count++] = {nearest, i};
  });
  sort_by(out, count, [](const RayCandidate& x) { return x.geom; });
  sort_candidates(out, count);
  return count;
}

[[gnu::noinline]] inline int focus_blocks(const KernelWorld& world, const KernelFilter& filter,
                                          const RayPacket* packets, int num_packets,
                                          float* const* low, float* const* high, int* ids) {
  int count = 0;
  for_each_in_blocks(Beam(packets, num_packets), world, filter,
                     [&](int i, float) { ids[count++] = i; });
  sort_by(ids, count, [](int i) { return i; });
  for (int n = 0; n < count; ++n) {
    for (int k = 0; k < 3; ++k) {
      low[k][n] = world.boxes.low[k][world.box_of_geom[ids[n]]];
      high[k][n] = world.boxes.high[k][world.box_of_geom[ids[n]]];
    }
  }
  return count;
}

inline int gather(const KernelWorld& world, const KernelFilter& filter, const RayPacket& rays,
                  RayCandidate* out) {
  if (world.blocks.count > 0) return gather_blocks(world, filter, rays, out);
  int count = 0;
  for_each_box(Beam(&rays, 1), world.boxes, [&](int i, float nearest) {
    if (passes(world, filter, i)) out[count++] = {nearest, i};
  });
  sort_candidates(out, count);
  return count;
}

inline int gather_from(const KernelBoxes& boxes, const RayPacket& rays, RayCandidate* out) {
  int count = 0;
  for_each_box(Beam(&rays, 1), boxes, [&](int i, float nearest) {
    out[count++] = {nearest, boxes.ids[i]};
  });
  sort_candidates(out, count);
  return count;
}

inline int cull(const KernelWorld& world, const KernelFilter& filter, const RayPacket* packets,
                int num_packets, float* const* low, float* const* high, int* ids) {
  if (world.blocks.count > 0)
    return focus_blocks(world, filter, packets, num_packets, low, high, ids);
  int count = 0;
  for_each_box(Beam(packets, num_packets), world.boxes, [&](int i, float) {
    if (!passes(world, filter, i)) return;
    for (int k = 0; k < 3; ++k) {
      low[k][count] = world.boxes.low[k][i];
      high[k][count] = world.boxes.high[k][i];
    }
    ids[count++] = i;
  });
  return count;
}

}  // namespace
}  // namespace mjsense::rays
