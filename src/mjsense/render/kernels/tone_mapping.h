// SPDX-License-Identifier: Apache-2.0
#pragma once
// From linear radiance to the colours of an image. Part of the tile kernels.

#include "mjsense/render/kernels/shading.h"

namespace mjsense::render {
namespace {

inline Float float_of(Int a) { return {(decltype(Float::v))a.v}; }

// Tone curve and sRGB's curve, see ToneCurve.
inline Float tone_curve(const float* table, Float x) {
  // max() also removes NaN.
  const Float y = min(max(x, splat(0.0f)), splat(ToneCurve::kEnd)) + splat(ToneCurve::kOffset);
  const Int at = bits_of(y);
  Int left, right;
  gather_pairs(reinterpret_cast<const std::uint32_t*>(table),
               shift_right(at, ToneCurve::kShift) + int_of(-ToneCurve::kFirst), left, right);
  const Float fraction =
      to_float(bits_and(at, (1 << ToneCurve::kShift) - 1)) * splat(1.0f / (1 << ToneCurve::kShift));
  return fma(fraction, float_of(right) - float_of(left), float_of(left));
}

// The Khronos PBR Neutral Tone Mapper: colours below 0.8 keep their hue and saturation.
// https://github.com/KhronosGroup/ToneMapping/tree/main/PBR_Neutral
inline Vec3f neutral(Vec3f c) {
  constexpr float kStart = 0.8f - 0.04f, kDesaturation = 0.15f;
  const Float zero = splat(0.0f), one = splat(1.0f);
  const Vec3f in{max(c.x, zero), max(c.y, zero), max(c.z, zero)};
  const Float low = min(in.x, min(in.y, in.z));
  const Float offset = select(low < splat(0.08f), low - splat(6.25f) * low * low, splat(0.04f));
  const Vec3f base{in.x - offset, in.y - offset, in.z - offset};
  const Float peak = max(base.x, max(base.y, base.z));
  constexpr float kRoom = 1 - kStart;
  const Float over = max(peak - splat(kStart), zero);
  const Float shown = select(zero < over, one - splat(kRoom * kRoom) / (over + splat(kRoom)), peak);
  const Float scale = shown / max(peak, splat(1e-6f));
  const Float mixed = one - one / fma(splat(kDesaturation), max(peak - shown, zero), one);
  const auto out = [&](Float x) {
    const Float bright = x * scale;
    return fma(mixed, shown - bright, bright);
  };
  return {out(base.x), out(base.y), out(base.z)};
}

inline Vec3f shown(const float* curve, Vec3f c) {
  return {tone_curve(curve, c.x), tone_curve(curve, c.y), tone_curve(curve, c.z)};
}

// Replaces linear radiance by colours in [0, 1].
inline void map_tones(const PhysicalView& p, Colors& colors) {
  for (int k = 0; k < kLanes; k += kWidth) {
    Vec3f c{load(colors.rgb[0] + k), load(colors.rgb[1] + k), load(colors.rgb[2] + k)};
    c = {c.x * splat(p.white[0]), c.y * splat(p.white[1]), c.z * splat(p.white[2])};
    if (p.tone_mapping == ToneMapping::kNeutral) c = neutral(c);
    if (p.tone_mapping == ToneMapping::kAgx) c = from_geom(p.agx_inset, c);
    c = shown(p.tone_curve, c);
    if (p.tone_mapping == ToneMapping::kAgx) c = shown(p.display_curve, from_geom(p.agx_outset, c));
    store(colors.rgb[0] + k, c.x);
    store(colors.rgb[1] + k, c.y);
    store(colors.rgb[2] + k, c.z);
  }
}

}  // namespace
}  // namespace mjsense::render
