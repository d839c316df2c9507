// SPDX-License-Identifier: Apache-2.0
#pragma once
// Windows of points and boxes in a light's image. Part of the tile kernels.

#include "mjsense/render/kernels/rays.h"

namespace mjsense::render {
namespace {

// Window of a set of points; all of them have w <= farthest.
struct LitWindow {
  float u0, u1, v0, v1, farthest;
  bool empty() const { return !(u0 <= u1 && v0 <= v1); }
};

// Window of the points of `lanes`, which must not be empty.
inline LitWindow window_of(const LightFrame& f, const float (*p)[kLanes], std::uint32_t lanes,
                           float error) {
  const Float endless = splat(kInfinity);
  Float u0 = endless, u1 = -endless, v0 = endless, v1 = -endless, w0 = endless, w1 = -endless;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Mask m = mask_of(lanes >> k & kAllLanes);
    const Vec3f q = Vec3f{load(p[0] + k), load(p[1] + k), load(p[2] + k)} - splat(f.origin);
    Float u = dot(q, splat(f.axes[0])), v = dot(q, splat(f.axes[1]));
    const Float w = dot(q, splat(f.axes[2]));
    if (f.perspective) {
      const Float inverse = splat(1.0f) / w;
      u = u * inverse;
      v = v * inverse;
    }
    u0 = min(u0, select(m, u, endless));
    u1 = max(u1, select(m, u, -endless));
    v0 = min(v0, select(m, v, endless));
    v1 = max(v1, select(m, v, -endless));
    w0 = min(w0, select(m, w, endless));
    w1 = max(w1, select(m, w, -endless));
  }
  LitWindow out{lane_min(u0), lane_max(u1), lane_min(v0), lane_max(v1), lane_max(w1) + error};
  float slack = error;
  if (f.perspective) {
    const float nearest = lane_min(w0) - error;
    float maximum = -out.u0;
    for (float x : {out.u1, -out.v0, out.v1}) maximum = x > maximum ? x : maximum;
    slack = nearest > error ? error * (1 + maximum) / nearest : kInfinity;
  }
  const auto minimum = [&](float x) { return x - slack > -f.limit ? x - slack : -f.limit; };
  out.u0 = minimum(out.u0);
  out.v0 = minimum(out.v0);
  out.u1 = -minimum(-out.u1);
  out.v1 = -minimum(-out.v1);
  return out;
}

// Returns which of kWidth windows from `first` on overlap b.
inline std::uint32_t overlaps(const LightWindows& a, int first, const LitWindow& b) {
  return bits((loadu(a.u_min + first) <= splat(b.u1)) & (splat(b.u0) <= loadu(a.u_max + first)) &
              (loadu(a.v_min + first) <= splat(b.v1)) & (splat(b.v0) <= loadu(a.v_max + first)) &
              (loadu(a.w_min + first) < splat(b.farthest)));
}

// Windows of a node's children.
struct alignas(64) ChildWindows {
  float u0[rays::kClusterSize], u1[rays::kClusterSize], v0[rays::kClusterSize],
      v1[rays::kClusterSize], w[rays::kClusterSize];
};

// Transform of a triangle geom into a light's frame.
struct SeenByLight {
  Vec3f rows[3], sizes[3];
  Float at[3];
  Float error;
  bool perspective;

  SeenByLight(const LightFrame& f, const ViewGeom& g, float tile_error)
      : perspective(f.perspective) {
    for (int i = 0; i < 3; ++i) {
      const float* a = f.axes[i];
      float row[3], offset = 0;
      for (int j = 0; j < 3; ++j) {
        row[j] = a[0] * g.rot[j] + a[1] * g.rot[3 + j] + a[2] * g.rot[6 + j];
        offset += a[j] * (g.pos[j] - f.origin[j]);
      }
      rows[i] = splat(row);
      sizes[i] = {abs(rows[i].x), abs(rows[i].y), abs(rows[i].z)};
      at[i] = splat(offset);
    }
    // Shadow rays from the geom's own surface start slightly above it.
    const float depth = g.center[2] < 0 ? -g.center[2] : g.center[2];
    error = splat(tile_error + kLightError * g.radius + 1e-4f * (depth + g.radius));
  }

  // Returns the children whose boxes overlap the window, and writes the windows of all children.
  std::uint32_t children(const rays::ClusterNode& node, const LitWindow& points,
                         ChildWindows& out) const {
    const Float zero = splat(0.0f), one = splat(1.0f);
    std::uint32_t near = 0;
    for (int k = 0; k < rays::kClusterSize; k += kWidth) {
      const Vec3f c{load(node.center[0] + k), load(node.center[1] + k), load(node.center[2] + k)};
      const Vec3f h{load(node.half[0] + k), load(node.half[1] + k), load(node.half[2] + k)};
      Float low[3], high[3];
      for (int i = 0; i < 3; ++i) {
        const Float middle = dot(rows[i], c) + at[i], half = dot(sizes[i], h) + error;
        low[i] = middle - half;
        high[i] = middle + half;
      }
      if (perspective) {
        const Mask ahead = error < low[2];
        const Float minimum = one / select(ahead, high[2], one),
                    maximum = one / select(ahead, low[2], one);
        for (int i = 0; i < 2; ++i) {
          low[i] =
              select(ahead, low[i] * select(low[i] < zero, maximum, minimum), splat(-kInfinity));
          high[i] =
              select(ahead, high[i] * select(zero < high[i], maximum, minimum), splat(kInfinity));
        }
      }
      store(out.u0 + k, low[0]);
      store(out.u1 + k, high[0]);
      store(out.v0 + k, low[1]);
      store(out.v1 + k, high[1]);
      store(out.w + k, low[2]);
      near |= overlaps({out.u0, out.u1, out.v0, out.v1, out.w}, k, points) << k;
    }
    return near & ((1u << node.count) - 1);
  }
};

}  // namespace
}  // namespace mjsense::render
