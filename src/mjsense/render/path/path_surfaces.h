// SPDX-License-Identifier: Apache-2.0
#pragma once
// What path tracing shares with the kernels of images: the surface at a hit, with its normal and
// textures, and the sky, haze and fog that a pixel shows. Frame: the camera's.

#include <span>

#include "mjsense/render/light/material.h"
#include "mjsense/render/light/microfacets.h"
#include "mjsense/render/path/path_scene.h"

namespace mjsense::render {

struct PathSurface {
  Substance substance;
  Vec3 normal;   // unit, by which it is shaded
  double alpha;  // 1: opaque
  Rgb64 glow;    // radiance that it emits
};

// Planes seen from behind, which images show as a veil, are opaque for light on their front.
inline bool lets_light_through(const ViewGeom& g) { return g.transparent && !g.shows_back; }

// Textures are read at their finest level, because the samples of a pixel are averaged. `points`: of the
// hits, m. Each hit has a geom.
void find_surfaces(const View& view, std::span<const PathHit> hits, std::span<const Vec3> points,
                   std::span<PathSurface> out);

// A pixel's ray: X and Y of PixelGrid, and what it hits.
struct PathPixel {
  float x, y;
  float t;       // planar depth, m; infinity: nothing
  int geom;      // index in View::geoms, or -1
  float rgb[3];  // radiance
};

// Replaces the radiance of pixels that hit nothing by the background's; adds haze and fog.
void add_background(const View& view, std::span<PathPixel> pixels);

}  // namespace mjsense::render
