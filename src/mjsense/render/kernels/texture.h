// SPDX-License-Identifier: Apache-2.0
#pragma once
// Texture coordinates and filtering as in OpenGL: bilinear within a mip level, linear between two
// levels. Part of the tile kernels.

#include "mjsense/render/kernels/rays.h"

namespace mjsense::render {
namespace {

using Ints = int __attribute__((vector_size(4 * kWidth)));

inline Int bits_and(Int a, int mask) { return {(decltype(a.v))((Ints)a.v & mask)}; }
inline Int shift_right(Int a, int n) { return {(decltype(a.v))((Ints)a.v >> n)}; }
inline Int bits_of(Float a) { return {(decltype(Int::v))a.v}; }
inline Int gather_int(const void* p, Int i) {
  return bits_of(gather(static_cast<const float*>(p), i));
}

struct Rgb {
  Float r, g, b;  // 0..255
};

inline Rgb unpack(Int t) {
  return {to_float(bits_and(t, 255)), to_float(bits_and(shift_right(t, 8), 255)),
          to_float(bits_and(shift_right(t, 16), 255))};
}

inline Rgb mix(Rgb a, Rgb b, Float f) {
  return {fma(f, b.r - a.r, a.r), fma(f, b.g - a.g, a.g), fma(f, b.b - a.b, a.b)};
}

// log2 of x >= 1 with an error of about 1%, which is sufficient to choose mip levels.
inline Float rough_log2(Float x) {
  const Int b = bits_of(x);
  const Float m = to_float(bits_and(b, 0x7fffff)) * splat(1.0f / 0x800000);
  return to_float(shift_right(b, 23)) + fma(splat(0.34f) * m, splat(1.0f) - m, m - splat(127.0f));
}

// Size and offset of a mip level, per lane.
struct Level {
  Float width, height;
  Int offset;

  Level(const Texture& texture, Float level) {
    const float first = first_lane(level);
    // Most packets need only one level.
    if (!any((level < splat(first)) | (splat(first) < level))) {
      const int i = static_cast<int>(first);
      width = splat(texture.width[i]);
      height = splat(texture.height[i]);
      offset = int_of(texture.offset[i]);
      return;
    }
    const Int i = truncate(level);
    width = gather(texture.width, i);
    height = gather(texture.height, i);
    offset = gather_int(texture.offset, i);
  }
};

// Samples one mip level at (s, t) in [0, 1].
inline Rgb bilinear(const Texture& texture, const Level& level, Int face, Float s, Float t) {
  const Float zero = splat(0.0f), one = splat(1.0f), half = splat(0.5f);
  const Float w = level.width, h = level.height;
  const Float u = fma(s, w, -half), v = fma(t, h, -half);
  Float x0 = floor(u), y0 = floor(v);
  Float fx = u - x0;
  const Float fy = v - y0;
  Float y1 = y0 + one;
  if (texture.cube) {
    fx = select(x0 < zero, zero, fx);
    x0 = max(x0, zero);
    y0 = max(y0, zero);
    y1 = min(y1, h - one);
  } else {
    x0 = select(x0 < zero, x0 + w, x0);
    y0 = select(y0 < zero, y0 + h, y0);
    y1 = select(y1 < h, y1, y1 - h);
  }
  const Int stride = truncate(w) + int_of(1);
  Int base = level.offset + truncate(x0);
  if (texture.cube) base = base + face * (stride * truncate(h));
  const auto row = [&](Float y) {
    Int left, right;
    gather_pairs(texture.texels, base + truncate(y) * stride, left, right);
    return mix(unpack(left), unpack(right), fx);
  };
  return mix(row(y0), row(y1), fy);
}

// Colour (0..255) in the lanes of `wanted`. (s, t): [0, 1) covers the texture once. `footprint`:
// size of a pixel in texels of level 0.
inline Rgb sample(const Texture& texture, Mask wanted, Int face, Float s, Float t,
                  Float footprint) {
  const Float zero = splat(0.0f);
  // NaN and huge values must still give a valid index.
  s = select(abs(s) < splat(1e6f), s, zero);
  t = select(abs(t) < splat(1e6f), t, zero);
  if (!texture.cube) {
    s = s - floor(s);
    t = t - floor(t);
  }
  const Float last = splat(static_cast<float>(texture.levels - 1));
  const Float size = min(max(footprint, splat(1.0f)), splat(65536.0f));
  Float lod = min(max(rough_log2(size), zero), last);
  if (any(~wanted)) lod = select(wanted, lod, splat(lane_min(select(wanted, lod, last))));
  // Two levels are blended only near the middle between them, as in Mesa and on GPUs.
  const Float moved = lod + splat(0.25f), level = floor(moved);
  if (texture.on_demand) {
    const int finest = static_cast<int>(lane_min(min(level, last)));
    if (finest < texture.finest) texture.on_demand->add_level(finest);
  }
  const Float between = max(fma(splat(2.0f), moved - level, splat(-1.0f)), zero);
  const Rgb near = bilinear(texture, Level(texture, min(level, last)), face, s, t);
  if (!any(between > splat(0.01f))) return near;
  const Level coarser(texture, min(level + splat(1.0f), last));
  return mix(near, bilinear(texture, coarser, face, s, t), between);
}

// Samples a cube map as OpenGL does: selects the face by the direction's largest component.
inline Rgb sample_cube(const Texture& texture, Mask wanted, Vec3f d, Float footprint) {
  const Float zero = splat(0.0f), half = splat(0.5f);
  const Float ax = abs(d.x), ay = abs(d.y), az = abs(d.z);
  const Mask is_x = (ax >= ay) & (ax >= az), not_z = is_x | (ay >= az);
  const Mask nx = d.x < zero, ny = d.y < zero, nz = d.z < zero;
  const Float m = max(max(ax, max(ay, az)), splat(kTiny));
  const Float s = select(is_x, select(nx, d.z, -d.z), select(not_z, d.x, select(nz, -d.x, d.x)));
  const Float t = select(is_x, -d.y, select(not_z, select(ny, -d.z, d.z), -d.y));
  const Int face =
      select(is_x, select(nx, int_of(1), int_of(0)),
             select(not_z, select(ny, int_of(3), int_of(2)), select(nz, int_of(5), int_of(4))));
  return sample(texture, wanted, texture.same_faces ? int_of(0) : face, fma(half, s / m, half),
                fma(half, t / m, half), footprint);
}

constexpr float kPi = 3.14159265358979f;

// Texture coordinates of a packet. `rate_u`, `rate_v`: their maximum rate of change, per metre.
struct Coordinates {
  Float u, v, rate_u, rate_v;
};

// Coordinates on a box; p: point on the surface, n: its normal; geom frame.
inline Coordinates box_uv(const ViewGeom& g, Vec3f p, Vec3f n) {
  const float* s = g.size;
  const Float half = splat(0.5f);
  const Mask x_face = half < abs(n.x), z_face = half < abs(n.z);
  const float k[3] = {0.5f / s[0], 0.5f / s[1], 0.5f / s[2]};
  const Float kx = select(x_face, splat(k[1]), splat(k[0]));
  const Float ky = select(z_face, splat(k[1]), splat(k[2]));
  return {fma(select(x_face, p.y, p.x), kx, half), fma(select(z_face, p.y, p.z), -ky, half), kx,
          ky};
}

// Coordinates on MuJoCo's curved primitives; p: point on the surface, geom frame. `per_meter_*`:
// maximum rate of change.
inline void curved_uv(const ViewGeom& g, const float* p, const float* n, float& u, float& v,
                      float& per_meter_u, float& per_meter_v) {
  const float* s = g.size;
  const bool ball = g.type == mjGEOM_SPHERE || g.type == mjGEOM_ELLIPSOID;
  const float sx = s[0], sy = g.type == mjGEOM_ELLIPSOID ? s[1] : s[0];
  const float x = p[0] / sx, y = p[1] / sy;
  if (g.type == mjGEOM_CYLINDER && (n[2] > 0.9f || n[2] < -0.9f)) {
    u = 0.5f * (1 + x);
    v = 0.5f * (1 + y);
    per_meter_u = per_meter_v = 0.5f / sx;
    return;
  }
  u = __builtin_atan2f(y, x) * (0.5f / kPi);
  if (u < 0) u += 1;
  const float ring = __builtin_sqrtf(x * x + y * y);
  per_meter_u = 1 / (2 * kPi * sx * (ring > 1e-3f ? ring : 1e-3f));
  if (ball) {
    const float sz = g.type == mjGEOM_ELLIPSOID ? s[2] : s[0];
    v = 0.5f - __builtin_atan2f(p[2] / sz, ring) / kPi;
    per_meter_v = 1 / (kPi * sz);
  } else if (g.type == mjGEOM_CYLINDER || (p[2] <= s[1] && p[2] >= -s[1])) {
    v = 0.5f * (1 - p[2] / s[1]);
    per_meter_v = 0.5f / s[1];
  } else {
    const float over = (p[2] < 0 ? -p[2] : p[2]) - s[1];
    const float up = __builtin_atan2f(over, ring * sx) * (2 / kPi);
    v = p[2] > 0 ? 1 - up : up;
    per_meter_v = 2 / (kPi * sx);
  }
}

}  // namespace
}  // namespace mjsense::render
