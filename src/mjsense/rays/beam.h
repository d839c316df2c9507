#pragma once
// Which geoms a packet can meet: the rays lie in a beam, a box of origins swept along a range of
// slopes over the axis that all directions agree on. Its cross-section over each geom's box
// decides, 4 to 16 geoms at a time.

#include "mjsense/rays/kernels.h"
#include "mjsense/rays/packet.h"
#include "mjsense/rays/ray_geom.h"
#include "mjsense/rays/simd.h"

namespace mjsense {
namespace {

inline float lane_min(Float x) {
  alignas(64) float v[kWidth];
  store(v, x);
  float m = v[0];
  for (int i = 1; i < kWidth; ++i) m = v[i] < m ? v[i] : m;
  return m;
}

struct Range {
  float low, high;
};

inline Range range_of(const float* x, const float* tmax) {
  Float low = kNoHit, high = kNoHit;  // `high` negated
  for (int k = 0; k < kPacket; k += kWidth) {
    const Mask active = load(tmax + k) >= Float(0.0f);
    low = min(low, select(active, load(x + k), Float(kNoHit)));
    high = min(high, select(active, -load(x + k), Float(kNoHit)));
  }
  return {lane_min(low), -lane_min(high)};
}

struct Beam {
  bool empty = false;       // no active lane
  bool everywhere = false;  // directions agree on no axis
  int axis = 0;
  float sign = 1.0f;
  Range origin[3];  // m, world
  Range slope[3];   // d[i] / |d[axis]|
  float tmax = 0.0f;

  explicit Beam(const RayPacket& rays) {
    tmax = -range_of_max(rays.tmax);
    if (!(tmax >= 0.0f)) {
      empty = true;
      return;
    }
    float best = 0.0f;
    for (int i = 0; i < 3; ++i) {
      const Range d = range_of(rays.d[i], rays.tmax);
      const float smallest = d.low > 0 ? d.low : (d.high < 0 ? -d.high : 0.0f);
      if (smallest > best) {
        best = smallest;
        axis = i;
        sign = d.low > 0 ? 1.0f : -1.0f;
      }
      const Range o = range_of(rays.o[i], rays.tmax);
      const float center = static_cast<float>(rays.origin[i]);
      const float error = 2e-7f * ((center < 0 ? -center : center) + 1.0f);
      origin[i] = {center + o.low - error, center + o.high + error};
    }
    everywhere = best < 1e-3f;
    if (everywhere) return;
    for (int i = 0; i < 3; ++i) {
      alignas(64) float s[kPacket];
      for (int k = 0; k < kPacket; k += kWidth)
        store(s + k, load(rays.d[i] + k) / abs(load(rays.d[axis] + k)));
      slope[i] = range_of(s, rays.tmax);
    }
  }

  static float range_of_max(const float* x) {
    Float m = kNoHit;
    for (int k = 0; k < kPacket; k += kWidth) m = min(m, -load(x + k));
    return lane_min(m);
  }

  // Lanes of geoms i .. i + kWidth - 1 whose box the beam touches, and a distance before which it
  // does not.
  Mask touches(const KernelWorld& world, int i, Float& nearest) const {
    const int a = axis, b = (axis + 1) % 3, c = (axis + 2) % 3;
    const Float lo = loadu(world.low[a] + i), hi = loadu(world.high[a] + i);
    const bool up = sign > 0;
    // How far along the axis the box begins and ends, seen from the nearest and the farthest
    // origin.
    const Float begin = max(up ? lo - origin[a].high : Float(origin[a].low) - hi, 0.0f);
    const Float end = up ? hi - origin[a].low : Float(origin[a].high) - lo;
    nearest = begin;
    Mask m = end >= Float(0.0f);
    for (int j : {b, c}) {
      const Float least = Float(origin[j].low) + min(begin * slope[j].low, end * slope[j].low);
      const Float most = Float(origin[j].high) + max(begin * slope[j].high, end * slope[j].high);
      m = m & (least <= loadu(world.high[j] + i)) & (most >= loadu(world.low[j] + i));
    }
    return m & (begin <= Float(tmax));
  }
};

inline int gather_candidates(const KernelWorld& world, const KernelFilter& filter,
                             const RayPacket& rays, RayCandidate* out) {
  const Beam beam(rays);
  if (beam.empty) return 0;
  int count = 0;
  const std::uint32_t refused = filter.transparent ? 0u : 0x100u;
  for (int i = 0; i < world.count; i += kWidth) {
    std::uint32_t in = kAllLanes;
    alignas(64) float nearest[kWidth] = {};
    if (!beam.everywhere) {
      Float t;
      in = bits(beam.touches(world, i, t));
      if (in == 0) continue;
      store(nearest, t);
    }
    for (; in != 0; in &= in - 1) {
      const int j = __builtin_ctz(in), id = i + j;
      const std::uint32_t flags = world.flags[id];
      if ((flags & filter.groups) == 0 || (flags & refused) != 0) continue;
      if (filter.exclude_body >= 0 && world.bodies[id] == filter.exclude_body) continue;
      if (filter.hidden != nullptr && filter.hidden[id] != 0) continue;
      out[count++] = {nearest[j], id};
    }
  }
  // Nearest first; Shell's sort: counts are small.
  for (int gap = count > 8 ? (count > 64 ? 31 : 5) : 1; gap > 0; gap = gap > 5 ? 5 : gap / 5) {
    for (int i = gap; i < count; ++i) {
      const RayCandidate x = out[i];
      int j = i;
      for (; j >= gap && out[j - gap].t > x.t; j -= gap) out[j] = out[j - gap];
      out[j] = x;
    }
  }
  return count;
}

}  // namespace
}  // namespace mjsense
