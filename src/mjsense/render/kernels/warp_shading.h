// SPDX-License-Identifier: Apache-2.0
#pragma once
// Shading of surfaces with mujoco_warp's light model. Part of the tile kernels. It differs from
// MuJoCo's classic one: textures do not change highlights, a light in shadow keeps a share, and
// distance and shadows do not reduce ambient light.
//
//   colour  clamp(texture * rgb * (emission + ambient + sum over lights of diffuse N.L)
//                 + sum over lights of highlights)

#include "mjsense/render/kernels/shading.h"

namespace mjsense::render {
namespace {

// mujoco_warp truncates colours to 8 bits, and the images here are rounded.
constexpr float kTruncated = 0.499f / 255;

// Computes the colours (0..1) of `lanes`. `shadows`: null to ignore shadows.
inline void shade_as_mujoco_warp(const View& view, const Surfaces& s, const Hits& hits,
                                 std::uint32_t lanes, Shadows* shadows, Colors& out) {
  Colors gloss = {};
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kLanes; k += kWidth)
      store(out.rgb[c] + k,
            load(s.emission + k) + splat(view.global_ambient + view.warp.ambient[c]));
  const ToEye eye(s);
  for (int i = 0; i < view.num_lights; ++i) {
    const ViewLight& light = view.lights[i];
    const Lit lit(light, s);
    const std::uint32_t dark =
        shadows && light.casts_shadows ? dark_lanes(view, i, lit, s, hits, lanes, *shadows) : 0;
    for (int k = 0; k < kLanes; k += kWidth) {
      const LightTerm& term = lit.terms[k / kWidth];
      const Float scale = term.scale * select(mask_of(dark >> k & kAllLanes),
                                              splat(view.warp.share_in_shadow), splat(1.0f));
      const Float matte = scale * term.diffuse;
      const Float shine = scale * highlight(term, s, eye, k, lanes) * load(s.specular + k);
      for (int c = 0; c < 3; ++c) {
        store(out.rgb[c] + k, fma(splat(light.diffuse[c]), matte, load(out.rgb[c] + k)));
        store(gloss.rgb[c] + k, fma(splat(light.specular[c]), shine, load(gloss.rgb[c] + k)));
      }
    }
  }
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kLanes; k += kWidth) {
      const Float surface = load(s.rgb[c] + k) * load(s.texture[c] + k);
      const Float sum = fma(load(out.rgb[c] + k), surface, load(gloss.rgb[c] + k));
      store(out.rgb[c] + k, max(min(sum, splat(1.0f)), splat(0.0f)) - splat(kTruncated));
    }
}

}  // namespace
}  // namespace mjsense::render
