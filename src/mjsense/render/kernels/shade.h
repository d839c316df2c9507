// SPDX-License-Identifier: Apache-2.0
#pragma once
// From surfaces to colours: MuJoCo's classic light model (OpenGL's fixed function, evaluated at
// every pixel). Part of the tile kernels.
//
//   base    clamp(emission + sum over lights without shadows)
//   light   attenuation * spot * (ambient + diffuse + specular)
//   colour  clamp(texture * (base + sum over lights with shadows, where not barred, of clamp(light)))

#include "mjsense/render/kernels/shadow.h"
#include "mjsense/render/kernels/surfaces.h"

namespace mjsense {
namespace {

struct alignas(64) Colors {
  float rgb[3][kLanes];
};

// x^n for x in [0, 1]; error below 0.002 where it matters (what 8 bits show).
inline Float power(Float x, Float n) {
  const Float zero = splat(0.0f), one = splat(1.0f), least = splat(0.3f);
  const Float floor_x = max(x, least);
  const Float s = (floor_x - one) / (floor_x + one), s2 = s * s;
  const Float log = splat(2.0f) * s *
                    fma(s2, fma(s2, fma(s2, splat(1.0f / 7), splat(0.2f)), splat(1.0f / 3)), one);
  Float y = fma(n * log, splat(1.0f / 256), one);        // (1 + n log x / 256)^256
  const Mask low = x < least, tiny = y < splat(0.874f);  // the result is below 1e-15
  const Mask none = tiny | (low & (splat(4.0f) <= n));
  if (!any(~none)) return zero;
  for (int i = 0; i < 8; ++i) y = y * y;
  return select(none, zero, select(low, x * y * splat(1.0f / 0.3f), y));
}

struct LightTerm {
  Float scale;           // attenuation * spot
  Float diffuse;         // N L
  Float specular;        // (N H)^exponent
  Vec3f to_light, unit;  // the same direction
};

inline LightTerm light_term(const ViewLight& light, Vec3f p, Vec3f n) {
  const Float zero = splat(0.0f), one = splat(1.0f);
  LightTerm out;
  out.scale = one;
  out.specular = zero;
  if (light.kind == LightKind::kDirectional) {
    out.to_light = out.unit = {splat(-light.dir[0]), splat(-light.dir[1]), splat(-light.dir[2])};
  } else {
    out.to_light = splat(light.pos) - p;
    const Float distance = sqrt(max(dot(out.to_light, out.to_light), splat(1e-20f)));
    const Float inverse = one / distance;
    const Vec3f l{out.to_light.x * inverse, out.to_light.y * inverse, out.to_light.z * inverse};
    out.unit = l;
    const float* a = light.attenuation;
    out.scale = one / max(fma(fma(splat(a[2]), distance, splat(a[1])), distance, splat(a[0])),
                          splat(1e-6f));
    if (light.kind == LightKind::kSpot) {
      const Float cosine = -dot(l, splat(light.dir));
      const Mask outside = cosine < splat(light.cos_cutoff);
      Float spot = one;
      if (light.exponent > 0 && any(~outside))
        spot = power(max(cosine, zero), splat(light.exponent));
      out.scale = out.scale * select(outside, zero, spot);
    }
  }
  out.diffuse = max(dot(n, out.unit), zero);
  return out;
}

// What makes points p directions to the viewer, which is the camera's origin, of orthographic cameras
// too: so it is in OpenGL.
struct alignas(64) ToEye {
  float scale[kLanes];

  explicit ToEye(const Surfaces& s) {
    for (int k = 0; k < kLanes; k += kWidth) {
      const Vec3f p{load(s.p[0] + k), load(s.p[1] + k), load(s.p[2] + k)};
      store(scale + k, splat(-1.0f) / sqrt(max(dot(p, p), splat(1e-20f))));
    }
  }
};

// One light on all lanes of a packet.
struct Lit {
  LightTerm terms[kLanes / kWidth];

  Lit() = default;
  Lit(const ViewLight& light, const Surfaces& s) {
    for (int k = 0; k < kLanes; k += kWidth) {
      const Vec3f p{load(s.p[0] + k), load(s.p[1] + k), load(s.p[2] + k)};
      const Vec3f n{load(s.n[0] + k), load(s.n[1] + k), load(s.n[2] + k)};
      terms[k / kWidth] = light_term(light, p, n);
    }
  }

  void add_specular(const Surfaces& s, const ToEye& eye, std::uint32_t lanes) {
    const Float zero = splat(0.0f), one = splat(1.0f);
    for (int k = 0; k < kLanes; k += kWidth) {
      LightTerm& term = terms[k / kWidth];
      const Mask glossy =
          (zero < term.diffuse) & (zero < load(s.specular + k)) & mask_of(lanes >> k & kAllLanes);
      if (!any(glossy)) continue;
      const Vec3f n{load(s.n[0] + k), load(s.n[1] + k), load(s.n[2] + k)};
      const Vec3f p{load(s.p[0] + k), load(s.p[1] + k), load(s.p[2] + k)};
      const Vec3f h = along(term.unit, load(eye.scale + k), p);
      const Float nh = dot(n, h) / sqrt(max(dot(h, h), splat(1e-20f)));
      term.specular = select(glossy, power(min(max(nh, zero), one), load(s.exponent + k)), zero);
    }
  }
};

// Adds the light's contribution to `sum`, for lanes that are not in `dark`; clamped to 1 by itself
// if `separate`.
inline void add_light(const ViewLight& light, const Lit& lit, const Surfaces& s, std::uint32_t dark,
                      bool separate, Colors& sum) {
  for (int k = 0; k < kLanes; k += kWidth) {
    const LightTerm& term = lit.terms[k / kWidth];
    const Float gloss = term.specular * load(s.specular + k);
    const Float scale = select(mask_of(dark >> k & kAllLanes), splat(0.0f), term.scale);
    for (int c = 0; c < 3; ++c) {
      const Float matte = fma(splat(light.diffuse[c]), term.diffuse, splat(light.ambient[c]));
      Float add = scale * fma(matte, load(s.rgb[c] + k), splat(light.specular[c]) * gloss);
      if (separate) add = min(add, splat(1.0f));
      store(sum.rgb[c] + k, load(sum.rgb[c] + k) + add);
    }
  }
}

// What casts shadows on a tile, by light. In a layered view fixed lanes of a packet know already
// where fixed geoms leave them in the dark.
struct Shadows {
  Casters fixed[View::kMaxLights], moving[View::kMaxLights];  // not layered: all are moving
  const FixedTile* known = nullptr;
  // Of the packet at hand:
  int packet = 0;
  std::uint32_t fixed_lanes = 0;
  bool settled = false;                          // all lanes are fixed, and it is known
  std::uint32_t settled_dark[View::kMaxLights];  // by light, which of them are dark
};

// Lanes that do not get light `index`: barred by a geom, or turned away.
inline std::uint32_t dark_lanes(const View& view, int index, const Lit& lit, const Surfaces& s,
                                const Hits& hits, std::uint32_t lanes, Shadows& shadows) {
  if (shadows.settled) return shadows.settled_dark[index];
  const ViewLight& light = view.lights[index];
  LightRays rays;
  const bool directional = light.kind == LightKind::kDirectional;
  std::uint32_t facing = 0, reachable = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f p{load(s.p[0] + k), load(s.p[1] + k), load(s.p[2] + k)};
    const LightTerm& term = lit.terms[k / kWidth];
    facing |= bits((splat(0.0f) < term.diffuse) & (splat(0.0f) < term.scale)) << k;
    store(rays.d[0] + k, term.to_light.x);
    store(rays.d[1] + k, term.to_light.y);
    store(rays.d[2] + k, term.to_light.z);
    // MuJoCo's directional lights have a place after all: nothing behind it casts a shadow.
    const Float end = directional ? dot(p - splat(light.pos), splat(light.dir)) : splat(1.0f);
    reachable |= bits(splat(0.0f) < end) << k;
    store(rays.end + k, end);
  }
  std::uint32_t dark = ~facing;
  if (shadows.known) dark |= shadows.known->dark[index][shadows.packet] & shadows.fixed_lanes;
  const std::uint32_t active = reachable & lanes & ~dark;
  if (!active || shadows.fixed[index].count + shadows.moving[index].count == 0) return dark;
  __builtin_memcpy(rays.p, s.p, sizeof rays.p);
  __builtin_memcpy(rays.n, s.n, sizeof rays.n);
  __builtin_memcpy(rays.geom, hits.geom, sizeof rays.geom);
  dark |= in_shadow(view, shadows.fixed[index], rays, active & ~shadows.fixed_lanes);
  return dark | in_shadow(view, shadows.moving[index], rays, active & ~dark);
}

// Colours 0..1 of `lanes`. No shadows: no light casts any here.
inline void shade(const View& view, const Surfaces& s, const Hits& hits, std::uint32_t lanes,
                  Shadows* shadows, Colors& out) {
  Colors separate = {};
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kLanes; k += kWidth) {
      const Float glow = load(s.emission + k) + splat(view.global_ambient);
      store(out.rgb[c] + k, glow * load(s.rgb[c] + k));
    }
  const ToEye eye(s);
  for (int i = 0; i < view.num_lights; ++i) {
    const ViewLight& light = view.lights[i];
    const bool barred = shadows && light.shadows;
    Lit lit(light, s);
    const std::uint32_t dark = barred ? dark_lanes(view, i, lit, s, hits, lanes, *shadows) : 0;
    if (!(lanes & ~dark)) continue;
    if (light.specular[0] + light.specular[1] + light.specular[2] > 0)
      lit.add_specular(s, eye, lanes & ~dark);
    add_light(light, lit, s, dark, barred, barred ? separate : out);
  }
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kLanes; k += kWidth) {
      const Float sum = min(load(out.rgb[c] + k), splat(1.0f)) + load(separate.rgb[c] + k);
      store(out.rgb[c] + k, min(sum * load(s.texture[c] + k), splat(1.0f)));
    }
}

}  // namespace
}  // namespace mjsense
