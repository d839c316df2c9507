// SPDX-License-Identifier: Apache-2.0
#pragma once
// Intersects packets of 16 pixels with one geom. Part of the tile kernels, which are compiled once
// per instruction set.

#include <mujoco/mujoco.h>

#include "mjsense/core/simd.h"
#include "mjsense/rays/embree.h"
#include "mjsense/rays/kernels.h"
#include "mjsense/rays/triangle_clusters.h"
#include "mjsense/render/view/tile_kernels.h"

namespace mjsense::render {
namespace {

constexpr int kLanes = 16;
constexpr float kInfinity = __builtin_inff();
constexpr float kTiny = 1e-20f;

// Rays of 4 x 4 pixels: X and Y of PixelGrid; lane = 4 * row + column.
struct alignas(64) Pixels {
  float x[kLanes], y[kLanes];
  float near[kLanes];  // minimum planar depth of a hit
  float window[4];     // X min, X max, Y min, Y max
};

struct alignas(64) Hits {
  float t[kLanes];   // planar depth; infinity: no hit
  int id[kLanes];    // geom id; -1: no hit
  int geom[kLanes];  // index into View::geoms; -1: no hit
  // The remaining fields are valid for triangles only.
  int prim[kLanes];  // face of a mesh; -1 for the walls of a height field
  float u[kLanes], v[kLanes];
  float n[3][kLanes];  // geom frame, any length
};

// Selects geoms of a layered view.
enum class Part { kAll, kFixed, kMoving };

inline bool belongs(const ViewGeom& g, Part part) {
  return part == Part::kAll || g.fixed == (part == Part::kFixed);
}

inline Float splat(float x) { return Float(x); }

inline Vec3f splat(const float* p) { return {splat(p[0]), splat(p[1]), splat(p[2])}; }

inline Vec3f cross(Vec3f a, Vec3f b) {
  return {fma(a.y, b.z, -(a.z * b.y)), fma(a.z, b.x, -(a.x * b.z)), fma(a.x, b.y, -(a.y * b.x))};
}

// Hit points of a packet's pixels, camera frame. Undefined in lanes without a hit.
inline Vec3f hit_point(const View& view, const Pixels& pixels, const Hits& hits, int k) {
  const Float t = load(hits.t + k), x = load(pixels.x + k), y = load(pixels.y + k);
  if (view.grid.orthographic) return {x, y, -t};
  return {t * x, t * y, -t};
}

// Bounding box of the points of `lanes`; low > high if there are none.
inline void bounds(const float (*p)[kLanes], std::uint32_t lanes, float* low, float* high) {
  for (int c = 0; c < 3; ++c) {
    Float minimum = splat(kInfinity), maximum = splat(-kInfinity);
    for (int k = 0; k < kLanes; k += kWidth) {
      const Mask m = mask_of(lanes >> k & kAllLanes);
      const Float x = load(p[c] + k);
      minimum = min(minimum, select(m, x, splat(kInfinity)));
      maximum = max(maximum, select(m, x, splat(-kInfinity)));
    }
    low[c] = lane_min(minimum);
    high[c] = lane_max(maximum);
  }
}

// R^T v.
inline Vec3f to_geom(const float* r, Vec3f v) {
  return {fma(splat(r[0]), v.x, fma(splat(r[3]), v.y, splat(r[6]) * v.z)),
          fma(splat(r[1]), v.x, fma(splat(r[4]), v.y, splat(r[7]) * v.z)),
          fma(splat(r[2]), v.x, fma(splat(r[5]), v.y, splat(r[8]) * v.z))};
}

// R v.
inline Vec3f from_geom(const float* r, Vec3f v) {
  return {fma(splat(r[0]), v.x, fma(splat(r[1]), v.y, splat(r[2]) * v.z)),
          fma(splat(r[3]), v.x, fma(splat(r[4]), v.y, splat(r[5]) * v.z)),
          fma(splat(r[6]), v.x, fma(splat(r[7]), v.y, splat(r[8]) * v.z))};
}

struct LocalRay {
  Vec3f o, d;
};

// Interval of a line inside a convex solid: enter <= exit, or (infinity, minus infinity) if it
// misses.
struct Interval {
  Float enter, exit;
};

inline Interval nothing() { return {splat(kInfinity), splat(-kInfinity)}; }
inline Interval where(Mask m, Interval a) {
  return {select(m, a.enter, splat(kInfinity)), select(m, a.exit, splat(-kInfinity))};
}

// Uses the distance of the line from the centre instead of a difference of large squares, so that
// silhouettes of small distant spheres stay round in single precision.
inline Interval sphere(Vec3f o, Vec3f d, float radius) {
  const Float a = dot(d, d);
  const Float middle = -dot(o, d) / a;
  const Vec3f q = along(o, middle, d);
  const Float rest = splat(radius * radius) - dot(q, q);
  const Float half = sqrt(max(rest, splat(0.0f)) / a);
  return where(rest >= splat(0.0f), {middle - half, middle + half});
}

inline Interval ellipsoid(Vec3f o, Vec3f d, const float* size) {
  const Vec3f s{splat(1.0f / size[0]), splat(1.0f / size[1]), splat(1.0f / size[2])};
  return sphere({o.x * s.x, o.y * s.y, o.z * s.z}, {d.x * s.x, d.y * s.y, d.z * s.z}, 1.0f);
}

inline Float safe_inverse(Float d) {
  return splat(1.0f) / select(abs(d) < splat(kTiny), splat(kTiny), d);
}

inline Interval slab(Float o, Float inverse, Float low, Float high) {
  const Float a = (low - o) * inverse, b = (high - o) * inverse;
  return {min(a, b), max(a, b)};
}

inline Interval box(Vec3f o, Vec3f d, const float* center, const float* half) {
  const Interval x =
      slab(o.x, safe_inverse(d.x), splat(center[0] - half[0]), splat(center[0] + half[0]));
  const Interval y =
      slab(o.y, safe_inverse(d.y), splat(center[1] - half[1]), splat(center[1] + half[1]));
  const Interval z =
      slab(o.z, safe_inverse(d.z), splat(center[2] - half[2]), splat(center[2] + half[2]));
  const Interval all{max(max(x.enter, y.enter), z.enter), min(min(x.exit, y.exit), z.exit)};
  return where(all.enter <= all.exit, all);
}

// The infinite cylinder around the z axis.
inline Interval tube(Vec3f o, Vec3f d, float radius) {
  const Float a = max(fma(d.x, d.x, d.y * d.y), splat(kTiny));
  const Float middle = -fma(o.x, d.x, o.y * d.y) / a;
  const Float qx = fma(middle, d.x, o.x), qy = fma(middle, d.y, o.y);
  const Float rest = splat(radius * radius) - fma(qx, qx, qy * qy);
  const Float half = sqrt(max(rest, splat(0.0f)) / a);
  return where(rest >= splat(0.0f), {middle - half, middle + half});
}

inline Interval cylinder(Vec3f o, Vec3f d, float radius, float half) {
  const Interval side = tube(o, d, radius);
  const Interval ends = slab(o.z, safe_inverse(d.z), splat(-half), splat(half));
  const Interval all{max(side.enter, ends.enter), min(side.exit, ends.exit)};
  return where(all.enter <= all.exit, all);
}

inline Interval capsule(Vec3f o, Vec3f d, float radius, float half) {
  const Interval middle = cylinder(o, d, radius, half);
  const Interval top = sphere({o.x, o.y, o.z - splat(half)}, d, radius);
  const Interval bottom = sphere({o.x, o.y, o.z + splat(half)}, d, radius);
  return {min(middle.enter, min(top.enter, bottom.enter)),
          max(middle.exit, max(top.exit, bottom.exit))};
}

inline Interval solid(const ViewGeom& g, Vec3f o, Vec3f d) {
  static constexpr float kOrigin[3] = {0, 0, 0};
  switch (g.type) {
    case mjGEOM_SPHERE:
      return sphere(o, d, g.size[0]);
    case mjGEOM_CAPSULE:
      return capsule(o, d, g.size[0], g.size[1]);
    case mjGEOM_ELLIPSOID:
      return ellipsoid(o, d, g.size);
    case mjGEOM_CYLINDER:
      return cylinder(o, d, g.size[0], g.size[1]);
    case mjGEOM_BOX:
      return box(o, d, kOrigin, g.size);
    default:
      return nothing();
  }
}

// Intersection with a plane within its size: from the front only, or from both sides.
inline Float plane(const ViewGeom& g, Vec3f o, Vec3f d, bool both_sides) {
  const Float t = -o.z * safe_inverse(d.z);
  const Vec3f p = along(o, t, d);
  Mask hit = splat(0.0f) < t;
  if (!both_sides) hit = hit & (d.z < splat(0.0f));
  if (g.size[0] > 0) hit = hit & (abs(p.x) <= splat(g.size[0]));
  if (g.size[1] > 0) hit = hit & (abs(p.y) <= splat(g.size[1]));
  return select(hit, t, splat(kInfinity));
}

// Elevation (m) at a fractional column and row on the border of a height field.
inline float border_height(const rays::HeightField& f, float column, float row) {
  const int c = column < 0 ? 0 : column >= f.cols - 1 ? f.cols - 2 : static_cast<int>(column);
  const int r = row < 0 ? 0 : row >= f.rows - 1 ? f.rows - 2 : static_cast<int>(row);
  const float fc = column - c, fr = row - r;
  const float* p = f.data + r * f.cols + c;
  const float low = p[0] + (p[1] - p[0]) * fc, high = p[f.cols] + (p[f.cols + 1] - p[f.cols]) * fc;
  return f.size[2] * (low + (high - low) * fr);
}

}  // namespace
}  // namespace mjsense::render
