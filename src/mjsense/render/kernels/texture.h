// SPDX-License-Identifier: Apache-2.0
#pragma once
// Texture coordinates and filtering as in OpenGL: bilinear within a mipmap level, linear between two
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

struct Alpha {
  Float a;  // 0..255
};

inline void unpack(Int t, Rgb& out) {
  out = {to_float(bits_and(t, 255)), to_float(bits_and(shift_right(t, 8), 255)),
         to_float(bits_and(shift_right(t, 16), 255))};
}
inline void unpack(Int t, Alpha& out) { out = {to_float(bits_and(shift_right(t, 24), 255))}; }

inline Rgb mix(Rgb a, Rgb b, Float f) {
  return {fma(f, b.r - a.r, a.r), fma(f, b.g - a.g, a.g), fma(f, b.b - a.b, a.b)};
}
inline Alpha mix(Alpha a, Alpha b, Float f) { return {fma(f, b.a - a.a, a.a)}; }

// sRGB's curve from a colour in [0, 1] to linear light; the error is below 3e-4.
inline Float srgb_to_linear(Float x) {
  const Float a = fma(x, splat(0.2157905f), splat(-0.6573604f));
  const Float b = fma(x, a, splat(1.0077318f));
  return x * fma(x, fma(x, b, splat(0.3785078f)), splat(0.0553303f));
}

// x = mantissa 2^exponent for x >= 1, with a mantissa of at least 1 and less than 2.
inline Float exponent_of(Float x) { return to_float(shift_right(bits_of(x), 23)) - splat(127.0f); }
inline Float mantissa_of(Float x) {
  return fma(to_float(bits_and(bits_of(x), 0x7fffff)), splat(1.0f / 0x800000), splat(1.0f));
}

// Size and offset of a mipmap level, per lane.
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

// Samples one mipmap level at (s, t) in [0, 1]. Texel: Rgb or Alpha.
template <class Texel>
inline Texel bilinear(const Texture& texture, const Level& level, Int face, Float s, Float t) {
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
    Texel first, second;
    unpack(left, first);
    unpack(right, second);
    return mix(first, second, fx);
  };
  return mix(row(y0), row(y1), fy);
}

// Colour or alpha (0..255) in the lanes of `wanted`. (s, t): [0, 1) covers the texture once.
// `footprint`: size of a pixel in texels of level 0.
template <class Texel = Rgb>
inline Texel sample(const Texture& texture, Mask wanted, Int face, Float s, Float t,
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
  // Two levels are blended only near the middle between them, as in Mesa and on GPUs: equally if a
  // pixel is sqrt(2) texels large, where the mantissa is 1.75.
  constexpr float kMiddle = 1.75f / 1.41421356f;
  Float size = min(max(footprint, splat(1.0f)), splat(65536.0f)) * splat(kMiddle);
  if (any(~wanted))
    size = select(wanted, size, splat(lane_min(select(wanted, size, splat(kInfinity)))));
  const Float level = exponent_of(size);
  if (texture.on_demand) {
    const int finest = static_cast<int>(lane_min(min(level, last)));
    if (finest < texture.finest) texture.on_demand->add_level(finest);
  }
  const Float between = max(fma(splat(2.0f), mantissa_of(size), splat(-3.0f)), zero);
  const Texel near = bilinear<Texel>(texture, Level(texture, min(level, last)), face, s, t);
  if (!any(between > splat(0.01f))) return near;
  const Level coarser(texture, min(level + splat(1.0f), last));
  return mix(near, bilinear<Texel>(texture, coarser, face, s, t), between);
}

// The face of a cube map that the direction d shows, selected by d's largest component as in OpenGL,
// and the place on it. s(v), t(v) and major(v) are the components of v in the face's frame.
struct CubeFace {
  Mask is_x, not_z, nx, ny, nz;
  Float major_d, place_s, place_t;  // places: -1..1

  explicit CubeFace(Vec3f d)
      : is_x((abs(d.x) >= abs(d.y)) & (abs(d.x) >= abs(d.z))),
        not_z(is_x | (abs(d.y) >= abs(d.z))),
        nx(d.x < splat(0.0f)),
        ny(d.y < splat(0.0f)),
        nz(d.z < splat(0.0f)),
        major_d(max(max(abs(d.x), max(abs(d.y), abs(d.z))), splat(kTiny))),
        place_s(s(d) / major_d),
        place_t(t(d) / major_d) {}

  Float s(Vec3f v) const {
    return select(is_x, select(nx, v.z, -v.z), select(not_z, v.x, select(nz, -v.x, v.x)));
  }
  Float t(Vec3f v) const { return select(is_x, -v.y, select(not_z, select(ny, -v.z, v.z), -v.y)); }
  Float major(Vec3f v) const {
    return select(is_x, select(nx, -v.x, v.x),
                  select(not_z, select(ny, -v.y, v.y), select(nz, -v.z, v.z)));
  }
  Int index() const {
    return select(
        is_x, select(nx, int_of(1), int_of(0)),
        select(not_z, select(ny, int_of(3), int_of(2)), select(nz, int_of(5), int_of(4))));
  }
  // Size in texels of a pixel from which to the next d changes by v, on a face of `width` texels.
  Float texels(Vec3f v, float width) const {
    const Float along = major(v);
    return max(abs(s(v) - place_s * along), abs(t(v) - place_t * along)) * splat(0.5f * width) /
           major_d;
  }
};

template <class Texel = Rgb>
inline Texel sample_cube(const Texture& texture, Mask wanted, const CubeFace& at, Float footprint) {
  const Float half = splat(0.5f);
  return sample<Texel>(texture, wanted, texture.same_faces ? int_of(0) : at.index(),
                       fma(half, at.place_s, half), fma(half, at.place_t, half), footprint);
}

constexpr float kPi = 3.14159265358979f;

// Texture coordinates of a packet, and how they change along the surface: gradients per metre, geom
// frame.
struct Coordinates {
  Float u, v;
  Vec3f du, dv;
};

// Coordinates on a box; p: point on the surface, n: its normal; geom frame.
inline Coordinates box_uv(const ViewGeom& g, Vec3f p, Vec3f n) {
  const float* s = g.size;
  const Float half = splat(0.5f), zero = splat(0.0f);
  const Mask x_face = half < abs(n.x), z_face = half < abs(n.z);
  const float k[3] = {0.5f / s[0], 0.5f / s[1], 0.5f / s[2]};
  const Float kx = select(x_face, splat(k[1]), splat(k[0]));
  const Float ky = select(z_face, splat(k[1]), splat(k[2]));
  return {fma(select(x_face, p.y, p.x), kx, half),
          fma(select(z_face, p.y, p.z), -ky, half),
          {select(x_face, zero, kx), select(x_face, kx, zero), zero},
          {zero, select(z_face, -ky, zero), select(z_face, zero, -ky)}};
}

// Scalar coordinates of one lane.
struct LaneCoordinates {
  float u, v;
  float du[3], dv[3];  // gradients, per metre, geom frame
};

// Coordinates on MuJoCo's curved primitives; p: point on the surface, n: its normal, geom frame.
inline LaneCoordinates curved_uv(const ViewGeom& g, const float* p, const float* n) {
  const float* s = g.size;
  const bool ball = g.type == mjGEOM_SPHERE || g.type == mjGEOM_ELLIPSOID;
  const float sx = s[0], sy = g.type == mjGEOM_ELLIPSOID ? s[1] : s[0];
  const float x = p[0] / sx, y = p[1] / sy;
  float u, v;
  if (g.type == mjGEOM_CYLINDER && (n[2] > 0.9f || n[2] < -0.9f))
    return {0.5f * (1 + x), 0.5f * (1 + y), {0.5f / sx, 0, 0}, {0, 0.5f / sy, 0}};
  u = __builtin_atan2f(y, x) * (0.5f / kPi);
  if (u < 0) u += 1;
  const float ring = __builtin_sqrtf(x * x + y * y), r = ring > 1e-3f ? ring : 1e-3f;
  const float turn = 1 / (2 * kPi * r * r);
  const float du[3] = {-y * turn / sx, x * turn / sy, 0};
  const float out[3] = {x / (r * sx), y / (r * sy), 0};  // gradient of `ring`
  float by_ring = 0, by_z;                               // how v changes with `ring` and p[2]
  if (ball) {
    const float sz = g.type == mjGEOM_ELLIPSOID ? s[2] : s[0];
    const float z = p[2] / sz, size = 1 / (kPi * (r * r + z * z));
    v = 0.5f - __builtin_atan2f(p[2] / sz, ring) / kPi;
    by_ring = z * size;
    by_z = -ring * size / sz;
  } else if (g.type == mjGEOM_CYLINDER || (p[2] <= s[1] && p[2] >= -s[1])) {
    v = 0.5f * (1 - p[2] / s[1]);
    by_z = -0.5f / s[1];
  } else {
    const float over = (p[2] < 0 ? -p[2] : p[2]) - s[1];
    const float up = __builtin_atan2f(over, ring * sx) * (2 / kPi);
    v = p[2] > 0 ? 1 - up : up;
    const float size = 2 / (kPi * (r * r * sx * sx + over * over));
    by_ring = (p[2] > 0 ? over : -over) * sx * size;
    by_z = -ring * sx * size;
  }
  return {u, v, {du[0], du[1], du[2]}, {by_ring * out[0], by_ring * out[1], by_z}};
}

}  // namespace
}  // namespace mjsense::render
