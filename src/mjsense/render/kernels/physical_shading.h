// SPDX-License-Identifier: Apache-2.0
#pragma once
// Physically based shading: the metallic-roughness material of glTF 2.0 in the light of the view's lights
// and of its environment. Part of the tile kernels.
//
//   specular  GGX distribution, height-correlated Smith visibility, Schlick's Fresnel term, and the
//             energy of further bounces between microfacets (Filament 4.4 and 4.7.2,
//             https://google.github.io/filament/Filament.html):
//             F = 1 + F0 (1 / (A + B) - 1) times the lobe, where A and B are those of SpecularTable
//   matte     what the specular lobe does not reflect: base (1 - metallic) (1 - albedo of the lobe)
//   metallic  mixes a dielectric with F0 = 0.16 specular^2 and a metal with F0 = base (glTF 2.0,
//             appendix B)
//   light     E cos(theta) (matte / pi + lobe), E: illuminance
//   ambient   matte irradiance / pi + (F0 A + F90 B) radiance in the mirrored direction ("split sum")

#include "mjsense/render/kernels/ambient_occlusion.h"
#include "mjsense/render/kernels/tone_mapping.h"
#include "mjsense/render/kernels/warp_shading.h"

namespace mjsense::render {
namespace {

// What the light model needs to know of the surfaces.
struct alignas(64) Reflectances {
  float matte[3][kLanes];
  float specular[3][kLanes];  // at normal incidence, with the energy of further bounces
  float grazing[3][kLanes];
  float albedo[3][kLanes];  // of the specular lobe
  float square[kLanes];     // alpha^2, alpha: roughness^2
  float cosine[kLanes];     // N . V
};

// A and B of SpecularTable.
struct LobeScale {
  Float a, b;

  LobeScale(const std::uint32_t* table, Float roughness, Float cosine) {
    constexpr int kRows = SpecularTable::kRows, kColumns = SpecularTable::kColumns;
    const Float row = min(max(roughness, splat(0.0f)), splat(1.0f)) * splat(kRows - 1);
    const Float column = min(max(cosine, splat(0.0f)), splat(1.0f)) * splat(kColumns - 1);
    const Int r = truncate(row), next = select(less(r, int_of(kRows - 1)), int_of(1), int_of(0));
    const Int c = truncate(column);
    const Float across = column - to_float(c), down = row - to_float(r);
    Float top[2], bottom[2];
    read(table, r * int_of(SpecularTable::kStride) + c, across, top);
    read(table, (r + next) * int_of(SpecularTable::kStride) + c, across, bottom);
    a = fma(down, bottom[0] - top[0], top[0]);
    b = fma(down, bottom[1] - top[1], top[1]);
  }
  static void read(const std::uint32_t* table, Int at, Float across, Float* out) {
    Int left, right;
    gather_pairs(table, at, left, right);
    const Float scale = splat(1.0f / 65535);
    for (int i = 0; i < 2; ++i) {
      const Float l = to_float(bits_and(shift_right(left, 16 * i), 0xffff)) * scale,
                  r = to_float(bits_and(shift_right(right, 16 * i), 0xffff)) * scale;
      out[i] = fma(across, r - l, l);
    }
  }
};

inline void find_reflectances(const View& view, const Surfaces& s, const ToEye& eye,
                              Reflectances& out) {
  const Float zero = splat(0.0f), one = splat(1.0f);
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f n = load3(s.n, k), p = load3(s.p, k);
    const Float cosine = min(max(abs(dot(n, p) * load(eye.scale + k)), splat(1e-4f)), one);
    const Float roughness = load(s.roughness + k), metallic = load(s.metallic + k);
    const LobeScale lobe(view.physical.specular_table, roughness, cosine);
    const Float loss = one / max(lobe.a + lobe.b, splat(1e-3f)) - one;
    // Filament 4.8.3.3: materials without any F0 reflect nothing at grazing incidence either.
    const auto grazing = [&](Float f0) { return min(f0 * splat(50 * 0.33f), one); };
    const Float f0 = load(s.specular + k);
    const Float plain = (one - metallic) * fma(f0, loss, one);
    const Float plain0 = plain * f0, plain90 = plain * grazing(f0);
    const Float whole = fma(f0, loss, one) * fma(f0, lobe.a, grazing(f0) * lobe.b);
    const Float under = (one - metallic) * max(one - whole, zero);
    Float base[3], mean = zero;
    for (int c = 0; c < 3; ++c) {
      base[c] = load(s.rgb[c] + k) * load(s.texture[c] + k);
      mean = fma(base[c], splat(1.0f / 3), mean);
    }
    const Float metal90 = grazing(mean);
    for (int c = 0; c < 3; ++c) {
      const Float gain = metallic * fma(base[c], loss, one);
      const Float low = fma(gain, base[c], plain0), high = fma(gain, metal90, plain90);
      store(out.matte[c] + k, under * base[c]);
      store(out.specular[c] + k, low);
      store(out.grazing[c] + k, high);
      store(out.albedo[c] + k, fma(low, lobe.a, high * lobe.b));
    }
    const Float alpha = max(roughness, splat(0.045f)) * max(roughness, splat(0.045f));
    store(out.square + k, alpha * alpha);
    store(out.cosine + k, cosine);
  }
}

// Adds the light that reaches lanes k .. k + kWidth - 1, except those in `dark`.
inline void add_direct(const ViewLight& light, const LightTerm& term, const Surfaces& s,
                       const Reflectances& r, const ToEye& eye, int k, std::uint32_t dark,
                       Colors& sum) {
  const Float zero = splat(0.0f), one = splat(1.0f), half = splat(0.5f);
  const Float lit = select(mask_of(dark >> k & kAllLanes), zero, term.scale * term.diffuse);
  if (!any(zero < lit)) return;
  const Vec3f p = load3(s.p, k);
  const Float to_eye = load(eye.scale + k), a2 = load(r.square + k), nv = load(r.cosine + k),
              nl = term.diffuse;
  const Float lv = min(max(dot(term.unit, p) * to_eye, -one), one);
  // With h = (l + v) / |l + v|: |l + v|^2 = 2 (1 + l . v) and n . h |l + v| = n . l + n . v.
  const Float apart = max(one + lv, splat(1e-6f)), near = nl + nv;
  const Float nh2 = min(half * near * near / apart, one);
  const Float t = fma(nh2, a2 - one, one);
  const Float rest = one - a2;
  const Float smith = fma(nl, sqrt(fma(nv * nv, rest, a2)), nv * sqrt(fma(nl * nl, rest, a2)));
  const Float lobe = half * a2 / max(t * t * smith, splat(1e-12f));  // pi D V
  const Float away = one - sqrt(half * apart);                       // 1 - V . H
  const Float away2 = away * away, fresnel = away2 * away2 * away;
  for (int c = 0; c < 3; ++c) {
    const Float low = load(r.specular[c] + k);
    const Float reflected = fma(fresnel, load(r.grazing[c] + k) - low, low);
    const Float add = lit * splat(light.diffuse[c]) * fma(lobe, reflected, load(r.matte[c] + k));
    store(sum.rgb[c] + k, load(sum.rgb[c] + k) + add);
  }
}

struct Radiance {
  Float r, g, b;
};

// GL_RGB9_E5: 9 bits of each channel, and 5 bits of an exponent that they share.
inline void unpack(Int t, Radiance& out) {
  const Ints exponent = ((Ints)shift_right(t, 27).v & 31) + (127 - 15 - 9);
  const Float scale = float_of({(decltype(t.v))(exponent << 23)});
  out = {to_float(bits_and(t, 511)) * scale, to_float(bits_and(shift_right(t, 9), 511)) * scale,
         to_float(bits_and(shift_right(t, 18), 511)) * scale};
}
inline Radiance mix(Radiance a, Radiance b, Float f) {
  return {fma(f, b.r - a.r, a.r), fma(f, b.g - a.g, a.g), fma(f, b.b - a.b, a.b)};
}

// The environment's radiance in the direction d (any length, environment's frame) as a lobe of this
// roughness sees it. The texels at the border of a face are on its edges.
inline Radiance environment_radiance(const Texture& map, Vec3f d, Float roughness) {
  const Float half = splat(0.5f), one = splat(1.0f);
  const CubeFace face(d);
  const float last = static_cast<float>(map.levels - 1);
  const Float at = min(max(roughness, splat(0.0f)), one) * splat(last);
  const Float lower = floor(at), between = at - lower;
  const auto read = [&](Float level) {
    const Level l(map, level);
    const auto place = [&](Float x, Float size) {
      return fma(fma(half, x, half), size - one, half) / size;
    };
    return bilinear<Radiance>(map, l, face.index(), place(face.place_s, l.width),
                              place(face.place_t, l.height));
  };
  const Radiance near = read(lower);
  if (!any(splat(0.01f) < between)) return near;
  return mix(near, read(min(lower + one, splat(last))), between);
}

// The radiance of a white matte surface of normal n in the light of the environment.
inline Radiance white_radiance(const PhysicalView& v, Vec3f n) {
  const Float terms[9] = {n.x,       n.y,       n.z,       n.x * n.x, n.y * n.y,
                          n.z * n.z, n.x * n.y, n.x * n.z, n.y * n.z};
  Float out[3];
  for (int c = 0; c < 3; ++c) {
    out[c] = splat(v.irradiance[0][c]);
    for (int i = 0; i < 9; ++i) out[c] = fma(terms[i], splat(v.irradiance[i + 1][c]), out[c]);
    out[c] = max(out[c], splat(0.0f));
  }
  return {out[0], out[1], out[2]};
}

// The same where geoms hide a part of the environment: without the light from their direction, and with what
// they reflect. They are lit from the opposite direction. How much of that light reaches them is not known;
// it is the mean of all and of the part that reaches this surface.
inline Radiance white_radiance(const PhysicalView& v, Vec3f n, const Openness& open, int k) {
  const Radiance whole = white_radiance(v, n);
  const Float weight = load(open.weight + k), zero = splat(0.0f), one = splat(1.0f);
  if (!any(zero < weight)) return whole;
  const Vec3f toward = load3(open.toward, k);
  const Float scale = inverse_sqrt(max(dot(toward, toward), splat(1e-12f)));
  const Vec3f d{toward.x * scale, toward.y * scale, toward.z * scale};
  const Radiance behind = white_radiance(v, d), across = white_radiance(v, {-d.x, -d.y, -d.z});
  const Float visible = load(open.visible + k), hidden = one - visible;
  const Float share = hidden / max(weight, splat(1e-6f)) * fma(visible, splat(0.5f), splat(0.5f));
  const auto lit = [&](Float all, Float blocked, Float reflected, const float* color) {
    return fma(share * load(color + k), reflected, max(fma(-hidden, blocked, all), zero));
  };
  return {lit(whole.r, behind.r, across.r, open.color[0]),
          lit(whole.g, behind.g, across.g, open.color[1]),
          lit(whole.b, behind.b, across.b, open.color[2])};
}

// Adds the light of the environment.
inline void add_ambient(const View& view, const Surfaces& s, const Reflectances& r,
                        const ToEye& eye, int k, const Openness& open, Colors& sum) {
  const PhysicalView& v = view.physical;
  const Vec3f n = load3(s.n, k), p = load3(s.p, k);
  const Float to_eye = load(eye.scale + k), nv = dot(n, p) * to_eye;
  // 2 (N . V) N - V
  const Vec3f mirrored{fma(splat(2.0f) * nv, n.x, -(p.x * to_eye)),
                       fma(splat(2.0f) * nv, n.y, -(p.y * to_eye)),
                       fma(splat(2.0f) * nv, n.z, -(p.z * to_eye))};
  const Radiance ahead =
      environment_radiance(*v.radiance, from_geom(v.r_ec, mirrored), load(s.roughness + k));
  const Float creases = load(s.occlusion + k), visible = load(open.visible + k) * creases;
  // Filament 5.6.2 (Lagarde): surfaces mirror what is above their horizon.
  const Float seen = load(r.cosine + k) + visible;
  const Float gloss = min(max(fma(seen, seen, visible - splat(1.0f)), splat(0.0f)), splat(1.0f));
  const Radiance white = white_radiance(v, n, open, k);
  const Float around[3] = {white.r, white.g, white.b}, radiance[3] = {ahead.r, ahead.g, ahead.b};
  for (int c = 0; c < 3; ++c) {
    const Float shine = load(r.albedo[c] + k) * (gloss * splat(v.radiance_scale[c]));
    const Float add = fma(load(r.matte[c] + k) * creases, around[c], shine * radiance[c]);
    store(sum.rgb[c] + k, load(sum.rgb[c] + k) + add);
  }
}

// Computes the radiance of `lanes`. `shadows`: null to ignore shadows and occlusion.
inline void shade_physical(const View& view, const Surfaces& s, const Hits& hits,
                           std::uint32_t lanes, Shadows* shadows, Colors& out) {
  const ToEye eye(s);
  Reflectances r;
  find_reflectances(view, s, eye, r);
  for (int k = 0; k < kLanes; k += kWidth) {
    for (int c = 0; c < 3; ++c)
      store(out.rgb[c] + k, load(s.glow[c] + k) * splat(view.physical.unit));
  }
  for (int i = 0; i < view.num_lights; ++i) {
    const ViewLight& light = view.lights[i];
    const Lit lit(light, s);
    const std::uint32_t dark = shadows && view.shadows && light.casts_shadows
                                   ? dark_lanes(view, i, lit, s, hits, lanes, *shadows)
                                   : ~lanes;
    if (!(lanes & ~dark)) continue;
    for (int k = 0; k < kLanes; k += kWidth)
      add_direct(light, lit.terms[k / kWidth], s, r, eye, k, dark, out);
  }
  Openness open;
  if (shadows && view.physical.occlusion_reach > 0)
    find_openness(view, shadows->near, s, hits, lanes, open);
  for (int k = 0; k < kLanes; k += kWidth) add_ambient(view, s, r, eye, k, open, out);
  if (view.fog.slope == 0) return;
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kLanes; k += kWidth)
      store(out.rgb[c] + k, behind_fog(view.fog, load(hits.t + k), load(out.rgb[c] + k), c));
}

// Computes the colours of `lanes`, or their radiance. `shadows`: null to ignore shadows.
inline void shade(const View& view, const Surfaces& s, const Hits& hits, std::uint32_t lanes,
                  Shadows* shadows, Colors& out) {
  if (view.physical.on) return shade_physical(view, s, hits, lanes, shadows, out);
  if (view.warp.on) return shade_as_mujoco_warp(view, s, hits, lanes, shadows, out);
  shade_classic(view, s, hits, lanes, shadows, out);
}

}  // namespace
}  // namespace mjsense::render
