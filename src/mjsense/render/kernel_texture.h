#pragma once
// Texture coordinates and filtering as OpenGL does them: bilinear, between two levels of the
// pyramid. Part of the tile kernels.

#include "mjsense/render/kernel_rays.h"

namespace mjsense {
namespace {

struct Color {
  float r, g, b;
};

inline Color texel(const MipLevel& level, int offset, int x, int y) {
  const std::uint32_t t = level.texels[offset + y * level.width + x];
  return {static_cast<float>(t & 255u), static_cast<float>(t >> 8 & 255u),
          static_cast<float>(t >> 16 & 255u)};
}

inline Color mix(Color a, Color b, float f) {
  return {a.r + (b.r - a.r) * f, a.g + (b.g - a.g) * f, a.b + (b.b - a.b) * f};
}

inline int floor_int(float x) {
  const int i = static_cast<int>(x);
  return i - (static_cast<float>(i) > x);
}

inline int wrap(int i, int n) {
  const int m = i % n;
  return m < 0 ? m + n : m;
}

inline int clamp_index(int i, int n) { return i < 0 ? 0 : i >= n ? n - 1 : i; }

// u, v in texels of this level; `offset`: first texel of the face.
inline Color bilinear(const MipLevel& level, int offset, float u, float v, bool repeat) {
  const int x0 = floor_int(u), y0 = floor_int(v);
  const float fx = u - x0, fy = v - y0;
  const int xa = repeat ? wrap(x0, level.width) : clamp_index(x0, level.width);
  const int xb = repeat ? wrap(x0 + 1, level.width) : clamp_index(x0 + 1, level.width);
  const int ya = repeat ? wrap(y0, level.height) : clamp_index(y0, level.height);
  const int yb = repeat ? wrap(y0 + 1, level.height) : clamp_index(y0 + 1, level.height);
  return mix(mix(texel(level, offset, xa, ya), texel(level, offset, xb, ya), fx),
             mix(texel(level, offset, xa, yb), texel(level, offset, xb, yb), fx), fy);
}

// log2 to about 1%: enough to choose between levels.
inline float rough_log2(float x) {
  std::uint32_t bits;
  __builtin_memcpy(&bits, &x, sizeof bits);
  const float mantissa_bits = static_cast<float>(bits & 0x7fffffu) * (1.0f / 0x800000);
  const float exponent = static_cast<float>(static_cast<int>(bits >> 23) - 127);
  return exponent + mantissa_bits + 0.34f * mantissa_bits * (1 - mantissa_bits);
}

// 0..255. s, t of one face, [0, 1) once around; `footprint`: pixel size in texels of level 0.
inline Color sample(const Texture& texture, int face, float s, float t, float footprint) {
  // Endless planes seen at the horizon: keep integers in range.
  if (!(s > -1e6f && s < 1e6f)) s = 0;
  if (!(t > -1e6f && t < 1e6f)) t = 0;
  if (!texture.cube) {
    s -= floor_int(s);
    t -= floor_int(t);
  }
  const int last = texture.levels - 1;
  float lod = footprint > 1.0f ? rough_log2(footprint) : 0.0f;
  if (!(lod < static_cast<float>(last))) lod = static_cast<float>(last);
  const int a = static_cast<int>(lod);
  const float f = lod - a;
  const auto at = [&](int n) {
    const MipLevel& level = texture.level[n];
    return bilinear(level, face * level.width * level.height, s * level.width - 0.5f,
                    t * level.height - 0.5f, !texture.cube);
  };
  const Color near = at(a);
  return f > 0.01f && a < last ? mix(near, at(a + 1), f) : near;
}

// OpenGL's cube map: which face a direction meets, and where on it.
inline Color sample_cube(const Texture& texture, float x, float y, float z, float footprint) {
  const float ax = x < 0 ? -x : x, ay = y < 0 ? -y : y, az = z < 0 ? -z : z;
  int face;
  float s, t, m;
  if (ax >= ay && ax >= az) {
    face = x >= 0 ? 0 : 1;
    m = ax;
    s = x >= 0 ? -z : z;
    t = -y;
  } else if (ay >= az) {
    face = y >= 0 ? 2 : 3;
    m = ay;
    s = x;
    t = y >= 0 ? z : -z;
  } else {
    face = z >= 0 ? 4 : 5;
    m = az;
    s = z >= 0 ? x : -x;
    t = -y;
  }
  m = m > 0 ? m : 1;
  return sample(texture, face, 0.5f * (s / m + 1), 0.5f * (t / m + 1), footprint);
}

constexpr float kPi = 3.14159265358979f;

// Coordinates of MuJoCo's primitives: p on the surface, geom frame. `per_meter`: how fast they
// change, at most.
inline void primitive_uv(const ViewGeom& g, const float* p, const float* n, float& u, float& v,
                         float& per_meter_u, float& per_meter_v) {
  const float* s = g.size;
  switch (g.type) {
    case mjGEOM_PLANE:
    case mjGEOM_HFIELD: {
      const float sx = g.height_field ? g.height_field->size[0] : s[0],
                  sy = g.height_field ? g.height_field->size[1] : s[1];
      u = sx > 0 ? 0.5f * (p[0] / sx + 1) : 0.5f * p[0];
      v = sy > 0 ? 0.5f * (1 - p[1] / sy) : -0.5f * p[1];
      per_meter_u = sx > 0 ? 0.5f / sx : 0.5f;
      per_meter_v = sy > 0 ? 0.5f / sy : 0.5f;
      return;
    }
    case mjGEOM_BOX: {
      const float nx = n[0] < 0 ? -n[0] : n[0], nz = n[2] < 0 ? -n[2] : n[2];
      const int a = nx > 0.5f ? 1 : 0, b = nz > 0.5f ? 1 : 2;
      u = 0.5f * (p[a] / s[a] + 1);
      v = 0.5f * (1 - p[b] / s[b]);
      per_meter_u = 0.5f / s[a];
      per_meter_v = 0.5f / s[b];
      return;
    }
    default:
      break;
  }
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
}  // namespace mjsense
