// SPDX-License-Identifier: Apache-2.0
#pragma once
// Shading of surfaces: MuJoCo's classic light model (OpenGL's fixed-function lighting, evaluated
// per pixel). Part of the tile kernels.
//
//   base    clamp(emission + sum over lights without shadows)
//   light   attenuation * spot * (ambient + diffuse + specular)
//   colour  clamp(texture * (base + sum over lights with shadows, where lit, of clamp(light)))

#include "mjsense/render/kernels/ambient_occlusion.h"
#include "mjsense/render/kernels/shadow_rays.h"
#include "mjsense/render/kernels/surfaces.h"

namespace mjsense::render {
namespace {

struct alignas(64) Colors {
  float rgb[3][kLanes];
};

// The colour `under` at planar depth t behind the view's fog.
inline Float behind_fog(const Fog& fog, Float t, Float under, int channel) {
  const Float density =
      min(max((t - splat(fog.start)) * splat(fog.slope), splat(0.0f)), splat(1.0f));
  return fma(density, splat(fog.rgb[channel]) - under, under);
}

// x^n for x in [0, 1]; the error is below 0.002 in the range that is visible in 8 bits.
inline Float power(Float x, Float n) {
  const Float zero = splat(0.0f), one = splat(1.0f), minimum = splat(0.3f);
  const Float floor_x = max(x, minimum);
  const Float s = (floor_x - one) / (floor_x + one), s2 = s * s;
  const Float log = splat(2.0f) * s *
                    fma(s2, fma(s2, fma(s2, splat(1.0f / 7), splat(0.2f)), splat(1.0f / 3)), one);
  Float y = fma(n * log, splat(1.0f / 256), one);          // (1 + n log x / 256)^256
  const Mask low = x < minimum, tiny = y < splat(0.874f);  // the result is below 1e-15
  const Mask none = tiny | (low & (splat(4.0f) <= n));
  if (!any(~none)) return zero;
  for (int i = 0; i < 8; ++i) y = y * y;
  return select(none, zero, select(low, x * y * splat(1.0f / 0.3f), y));
}

struct LightTerm {
  Float scale;           // attenuation * spot
  Float diffuse;         // N . L
  Vec3f to_light, unit;  // the same direction: not normalised, normalised
};

inline Float attenuation(const ViewLight& light, Float distance) {
  const float* a = light.attenuation;
  // MuJoCo's default
  if (a[1] == 0 && a[2] == 0) return splat(1.0f / (a[0] > 1e-6f ? a[0] : 1e-6f));
  const Float loss = fma(fma(splat(a[2]), distance, splat(a[1])), distance, splat(a[0]));
  return splat(1.0f) / max(loss, splat(1e-6f));
}

// For lanes k .. k + kWidth - 1.
inline LightTerm light_term(const ViewLight& light, const Surfaces& s, int k) {
  const Float zero = splat(0.0f), one = splat(1.0f);
  const Vec3f n{load(s.n[0] + k), load(s.n[1] + k), load(s.n[2] + k)};
  if (light.kind == LightKind::kDirectional) {
    const Vec3f l{splat(-light.dir[0]), splat(-light.dir[1]), splat(-light.dir[2])};
    return {one, max(dot(n, l), zero), l, l};
  }
  const Vec3f p{load(s.p[0] + k), load(s.p[1] + k), load(s.p[2] + k)};
  const Vec3f offset = splat(light.pos) - p;
  const Float distance = sqrt(max(dot(offset, offset), splat(1e-20f)));
  const Float inverse = one / distance;
  const Vec3f l{offset.x * inverse, offset.y * inverse, offset.z * inverse};
  Float scale = attenuation(light, distance);
  if (light.range > 0) {  // glTF 2.0, KHR_lights_punctual
    const Float part = distance * splat(1 / light.range), part2 = part * part;
    scale = scale * max(one - part2 * part2, zero);
  }
  if (light.kind == LightKind::kSpot) {
    const Float cosine = -dot(l, splat(light.dir));
    const Mask outside = cosine < splat(light.cos_cutoff);
    Float spot = one;
    if (light.exponent > 0 && any(~outside)) spot = power(max(cosine, zero), splat(light.exponent));
    scale = scale * select(outside, zero, spot);
  }
  return {scale, max(dot(n, l), zero), offset, l};
}

// Factor that scales a point p to the unit direction to the viewer. As in OpenGL, the viewer is at
// the camera's origin, for orthographic cameras too.
struct alignas(64) ToEye {
  float scale[kLanes];

  explicit ToEye(const Surfaces& s) {
    for (int k = 0; k < kLanes; k += kWidth) {
      const Vec3f p{load(s.p[0] + k), load(s.p[1] + k), load(s.p[2] + k)};
      store(scale + k, splat(-1.0f) / sqrt(max(dot(p, p), splat(1e-20f))));
    }
  }
};

// One light's terms for all lanes of a packet.
struct Lit {
  LightTerm terms[kLanes / kWidth];

  Lit() = default;
  Lit(const ViewLight& light, const Surfaces& s) {
    for (int k = 0; k < kLanes; k += kWidth) terms[k / kWidth] = light_term(light, s, k);
  }
};

// (N . H)^exponent for lanes k .. k + kWidth - 1; 0 for lanes outside `lanes` and for surfaces
// without specular reflection.
inline Float highlight(const LightTerm& term, const Surfaces& s, const ToEye& eye, int k,
                       std::uint32_t lanes) {
  const Float zero = splat(0.0f), one = splat(1.0f);
  Mask glossy =
      (zero < term.diffuse) & (zero < load(s.specular + k)) & mask_of(lanes >> k & kAllLanes);
  if (!any(glossy)) return zero;
  const Vec3f n{load(s.n[0] + k), load(s.n[1] + k), load(s.n[2] + k)};
  const Vec3f p{load(s.p[0] + k), load(s.p[1] + k), load(s.p[2] + k)};
  const Vec3f h = along(term.unit, load(eye.scale + k), p);
  const Float near = dot(n, h), ahead = max(near, zero), size = dot(h, h);
  // Most packets are far from the highlight; skip the square root and the power.
  glossy = glossy & ~(ahead * ahead < load(s.highlight_threshold + k) * size);
  if (!any(glossy)) return zero;
  const Float nh = near / sqrt(max(size, splat(1e-20f)));
  return select(glossy, power(min(max(nh, zero), one), load(s.exponent + k)), zero);
}

// Adds the light's contribution to `sum` for lanes k .. k + kWidth - 1, except for lanes in `dark`.
// `separate`: clamp the contribution to 1 first.
inline void add_light(const ViewLight& light, const LightTerm& term, const Surfaces& s,
                      const ToEye& eye, int k, std::uint32_t lanes, std::uint32_t dark,
                      bool separate, Colors& sum) {
  const bool shines = light.specular[0] + light.specular[1] + light.specular[2] > 0;
  const Float gloss =
      shines ? highlight(term, s, eye, k, lanes & ~dark) * load(s.specular + k) : splat(0.0f);
  const Float scale = select(mask_of(dark >> k & kAllLanes), splat(0.0f), term.scale);
  for (int c = 0; c < 3; ++c) {
    const Float matte = fma(splat(light.diffuse[c]), term.diffuse, splat(light.ambient[c]));
    Float add = scale * fma(matte, load(s.rgb[c] + k), splat(light.specular[c]) * gloss);
    if (separate) add = min(add, splat(1.0f));
    store(sum.rgb[c] + k, load(sum.rgb[c] + k) + add);
  }
}

// Shadow casters of a tile, per light, and what hides the environment from it. In a layered view, the fixed lanes of a packet already store
// which of them are shadowed by fixed geoms.
struct Shadows {
  // If the view is not layered, all casters are in `moving`.
  Casters fixed[kMaxLights], moving[kMaxLights];
  const FixedTile* known = nullptr;
  Occluders near;
  // State of the current packet:
  int packet = 0;
  std::uint32_t fixed_lanes = 0;
  bool settled = false;                    // all lanes show fixed geoms and settled_dark is valid
  std::uint32_t settled_dark[kMaxLights];  // dark lanes, per light
};

// Whether the colour of a surface depends on other geoms.
inline bool needs_others(const View& view) {
  return view.shadows || view.physical.occlusion_reach > 0;
}

// Lanes that light `index` does not reach: in shadow, or facing away.
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
    // MuJoCo's directional lights have a position: geoms behind it cast no shadow.
    Float end = directional ? dot(p - splat(light.pos), splat(light.dir)) : splat(1.0f);
    Mask shadowed = splat(0.0f) < end;
    if (light.shadow_map_half_size > 0) {
      const Vec3f from = p - splat(light.pos);
      const Float u = dot(from, splat(light.shadow_map_axes[0])),
                  v = dot(from, splat(light.shadow_map_axes[1]));
      const Float depth = directional ? splat(1.0f) : dot(from, splat(light.dir));
      end = end - splat(light.shadow_map_near) / depth;
      shadowed =
          (splat(0.0f) < end) & (max(abs(u), abs(v)) < splat(light.shadow_map_half_size) * depth);
    }
    reachable |= bits(shadowed) << k;
    store(rays.end + k, end);
  }
  std::uint32_t dark = ~facing;
  if (shadows.known) dark |= shadows.known->unlit[index][shadows.packet] & shadows.fixed_lanes;
  const std::uint32_t active = reachable & lanes & ~dark;
  if (!active || shadows.fixed[index].count + shadows.moving[index].count == 0) return dark;
  rays.p = s.p;
  rays.n = s.n;
  rays.geom = hits.geom;
  rays.face = hits.prim;
  dark |= in_shadow(view, shadows.fixed[index], rays, active & ~shadows.fixed_lanes);
  return dark | in_shadow(view, shadows.moving[index], rays, active & ~dark);
}

// Computes the colours (0..1) of `lanes`. `shadows`: null to ignore shadows.
inline void shade_classic(const View& view, const Surfaces& s, const Hits& hits,
                          std::uint32_t lanes, Shadows* shadows, Colors& out) {
  Colors separate;
  if (shadows) separate = {};
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kLanes; k += kWidth) {
      const Float glow = load(s.emission + k) + splat(view.global_ambient);
      store(out.rgb[c] + k, glow * load(s.rgb[c] + k));
    }
  const ToEye eye(s);
  for (int i = 0; i < view.num_lights; ++i) {
    const ViewLight& light = view.lights[i];
    const bool barred = shadows && light.casts_shadows;
    if (!barred) {
      for (int k = 0; k < kLanes; k += kWidth)
        add_light(light, light_term(light, s, k), s, eye, k, lanes, 0, false, out);
      continue;
    }
    const Lit lit(light, s);
    const std::uint32_t dark = dark_lanes(view, i, lit, s, hits, lanes, *shadows);
    if (!(lanes & ~dark)) continue;
    for (int k = 0; k < kLanes; k += kWidth)
      add_light(light, lit.terms[k / kWidth], s, eye, k, lanes, dark, true, separate);
  }
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kLanes; k += kWidth) {
      Float sum = min(load(out.rgb[c] + k), splat(1.0f));
      if (shadows) sum = sum + load(separate.rgb[c] + k);
      store(out.rgb[c] + k, min(sum * load(s.texture[c] + k), splat(1.0f)));
    }
  if (view.fog.slope == 0) return;
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kLanes; k += kWidth)
      store(out.rgb[c] + k, behind_fog(view.fog, load(hits.t + k), load(out.rgb[c] + k), c));
}

}  // namespace
}  // namespace mjsense::render
