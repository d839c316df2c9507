// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/path/path_surfaces.h"

#include <algorithm>
#include <cstddef>

#include "mjsense/render/kernels/sky.h"

namespace mjsense::render {

void find_surfaces(const View& view, std::span<const PathHit> hits, std::span<const Vec3> points,
                   std::span<PathSurface> out) {
  for (std::size_t first = 0; first < hits.size(); first += kLanes) {
    const int count = static_cast<int>(std::min<std::size_t>(kLanes, hits.size() - first));
    Pixels pixels = {};
    Hits at = {};  // t = 0: the pixel's size on the surface is 0
    Surfaces s = {};
    for (int i = 0; i < kLanes; ++i) {
      const PathHit& hit = hits[first + std::min(i, count - 1)];
      const Vec3& p = points[first + std::min(i, count - 1)];
      const ViewGeom& g = view.geoms[hit.geom];
      at.geom[i] = hit.geom;
      at.id[i] = g.id;
      at.prim[i] = hit.prim;
      at.u[i] = hit.u;
      at.v[i] = hit.v;
      for (int k = 0; k < 3; ++k) {
        s.p[k][i] = static_cast<float>(p[k]);
        at.n[k][i] = g.rot[k] * hit.n[0] + g.rot[3 + k] * hit.n[1] + g.rot[6 + k] * hit.n[2];
      }
    }
    gather_at_points(view, pixels, at, (2u << (count - 1)) - 1, true, s);
    for (int k = 0; k < kLanes; k += kWidth)
      for (int c = 0; c < 3; ++c) store(s.rgb[c] + k, load(s.rgb[c] + k) * load(s.texture[c] + k));
    for (int i = 0; i < count; ++i) {
      PathSurface& o = out[first + i];
      for (int k = 0; k < 3; ++k) {
        o.substance.base[k] = s.rgb[k][i];
        o.normal[k] = s.n[k][i];
        o.glow[k] = static_cast<double>(s.glow[k][i]) * view.physical.unit;
      }
      o.substance.metallic = s.metallic[i];
      o.substance.roughness = s.roughness[i];
      o.substance.f0 = s.specular[i];
      o.alpha = lets_light_through(view.geoms[at.geom[i]]) ? s.alpha[i] : 1.0;
    }
  }
}

void add_background(const View& view, std::span<PathPixel> pixels) {
  for (std::size_t first = 0; first < pixels.size(); first += kLanes) {
    const int count = static_cast<int>(std::min<std::size_t>(kLanes, pixels.size() - first));
    Pixels at = {};
    Hits hits = {};
    Colors colors = {};
    std::uint32_t missed = 0;
    for (int i = 0; i < kLanes; ++i) {
      const PathPixel& pixel = pixels[first + std::min(i, count - 1)];
      at.x[i] = pixel.x;
      at.y[i] = pixel.y;
      hits.t[i] = pixel.t;
      hits.geom[i] = pixel.geom;
      if (pixel.geom < 0) missed |= 1u << i;
      for (int c = 0; c < 3; ++c) colors.rgb[c][i] = pixel.rgb[c];
    }
    if (view.fog.slope != 0)
      for (int c = 0; c < 3; ++c)
        for (int k = 0; k < kLanes; k += kWidth)
          store(colors.rgb[c] + k,
                behind_fog(view.fog, load(hits.t + k), load(colors.rgb[c] + k), c));
    if (missed) shade_background(view, at, missed, colors);
    if (view.sky_distance > 0) add_haze(view, at, hits, colors);
    for (int i = 0; i < count; ++i)
      for (int c = 0; c < 3; ++c) pixels[first + i].rgb[c] = colors.rgb[c][i];
  }
}

}  // namespace mjsense::render
