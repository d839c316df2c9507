// SPDX-License-Identifier: Apache-2.0
#pragma once
// Background of a packet: the skybox, and the haze in front of it. Part of the tile kernels.

#include "mjsense/render/kernels/physical_shading.h"

namespace mjsense::render {
namespace {

// How far the sky's cylinder is in the direction `w` (world frame), as a divisor of its radius.
inline Float cylinder_reach(const Vec3f& w) {
  return max(sqrt(fma(w.x, w.x, w.y * w.y)), abs(w.z));
}

// Replaces the colours of the skybox in the direction d (camera frame) by radiance.
inline void find_sky_radiance(const View& view, Vec3f d, Float* parts) {
  const PhysicalView& p = view.physical;
  for (int c = 0; c < 3; ++c) parts[c] = srgb_to_linear(parts[c]) * splat(p.unit);
  if (!p.shows_environment) return;
  const Radiance seen = environment_radiance(*p.radiance, from_geom(p.r_ec, d), splat(0.0f));
  parts[0] = seen.r * splat(p.radiance_scale[0]);
  parts[1] = seen.g * splat(p.radiance_scale[1]);
  parts[2] = seen.b * splat(p.radiance_scale[2]);
}

inline void shade_background(const View& view, const Pixels& pixels, std::uint32_t lanes,
                             Colors& out) {
  const bool ortho = view.grid.orthographic;
  const float* r = view.r_wc;
  const float step = view.grid.dx < 0 ? -view.grid.dx : view.grid.dx;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Mask m = mask_of(lanes >> k & kAllLanes);
    if (!any(m)) continue;
    const Float zero = splat(0.0f);
    const Vec3f d{ortho ? zero : load(pixels.x + k), ortho ? zero : load(pixels.y + k),
                  splat(-1.0f)};
    const Vec3f w = from_geom(r, d);
    // MuJoCo rotates the skybox by 90 degrees about x.
    Rgb color{zero, zero, zero};
    if (view.skybox)
      color = sample_cube(*view.skybox, m, CubeFace({w.x, w.z, -w.y}),
                          splat(0.5f * step * view.skybox->width[0]));
    const Float scale = splat(1.0f / 255);
    Float parts[3] = {color.r * scale, color.g * scale, color.b * scale};
    if (view.physical.on) find_sky_radiance(view, d, parts);
    for (int c = 0; c < 3; ++c) {
      Float part = parts[c];
      if (view.skybox && view.fog.slope != 0)
        part = behind_fog(view.fog, splat(view.sky_fog_radius) / cylinder_reach(w), part, c);
      store(out.rgb[c] + k, select(m, part, load(out.rgb[c] + k)));
    }
  }
}

// MuJoCo's sky is a cylinder around the camera that hides everything beyond it. The haze is the
// inside of a cone that rises from the plane, at 1 - width of the cylinder's radius, to its rim at
// the height of the camera. It is densest where the plane meets the cylinder and fades towards both
// of its borders.
inline void add_haze(const View& view, const Pixels& pixels, const Hits& hits, Colors& out) {
  const Haze& haze = view.haze;
  const Float zero = splat(0.0f), one = splat(1.0f), distance = splat(view.sky_distance);
  for (int k = 0; k < kLanes; k += kWidth) {
    Float t = load(hits.t + k);
    if (!any(splat(view.sky_min_depth) < t)) continue;
    const Vec3f d{load(pixels.x + k), load(pixels.y + k), splat(-1.0f)};
    const Vec3f w = from_geom(view.r_wc, d);
    const Mask hidden = less(int_of(-1), load(hits.geom + k)) & (distance < t * cylinder_reach(w));
    if (any(hidden)) {
      shade_background(view, pixels, bits(hidden) << k, out);
      t = select(hidden, splat(kInfinity), t);
    }
    if (haze.height <= 0) continue;
    const Float rise = dot(d, splat(haze.up));
    const Float level = sqrt(max(dot(d, d) - rise * rise, splat(kTiny)));
    const Float slope = splat(-view.sky_distance / haze.height) * rise / level;
    const Float radius = one / fma(splat(haze.width), slope, one);
    const Float height = one - slope * radius;
    const Mask inside = (zero < slope) & (zero < height) & (radius * distance < t * level);
    if (!any(inside)) continue;
    const float densest = haze.width / (1 + haze.width);
    const Float alpha = select(
        inside,
        min(height * splat(1 / (densest + 1e-6f)), (one - height) * splat(1 / (1 - densest))),
        zero);
    for (int c = 0; c < 3; ++c) {
      const Float under = load(out.rgb[c] + k);
      Float over = splat(haze.rgb[c]);
      if (view.fog.slope != 0) over = behind_fog(view.fog, radius * distance / level, over, c);
      store(out.rgb[c] + k, fma(alpha, over - under, under));
    }
  }
}

}  // namespace
}  // namespace mjsense::render
