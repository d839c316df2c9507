// SPDX-License-Identifier: Apache-2.0
#pragma once
// Writes the results of a packet of pixels to the output images. Part of the tile kernels.

#include "mjsense/render/kernels/transparency.h"

namespace mjsense::render {
namespace {

// Copies `values` [16, n] of a packet into the image [H, W, n].
template <int n, typename T>
void write_pixels(const PixelGrid& grid, int x0, int y0, const T* values, T* image) {
  const int columns = grid.width - x0 < 4 ? grid.width - x0 : 4;
  const int rows = grid.height - y0 < 4 ? grid.height - y0 : 4;
  for (int r = 0; r < rows; ++r) {
    T* out = image + n * (static_cast<std::size_t>(y0 + r) * grid.width + x0);
    if (columns == 4) {
      __builtin_memcpy(out, values + 4 * n * r, 4 * n * sizeof(T));
    } else {
      for (int i = 0; i < n * columns; ++i) out[i] = values[4 * n * r + i];
    }
  }
}

inline void write_depth(const View& view, const ImageTargets& targets, int x0, int y0,
                        const Pixels& pixels, const Hits& hits) {
  alignas(64) float depth[kLanes];
  for (int k = 0; k < kLanes; k += kWidth) {
    Float t = load(hits.t + k);
    if (targets.depth_along_ray && !view.grid.orthographic) {
      const Float px = load(pixels.x + k), py = load(pixels.y + k);
      t = t * sqrt(fma(px, px, fma(py, py, splat(1.0f))));
    }
    store(depth + k, select(less(int_of(-1), load(hits.geom + k)), t, splat(0.0f)));
  }
  write_pixels<1>(view.grid, x0, y0, depth, targets.depth);
}

inline void write_segmentation(const View& view, std::int32_t* image, int x0, int y0,
                               const Hits& hits) {
  std::int32_t ids[kLanes][2];
  int last = -1;
  std::int32_t id = -1, object = -1;
  for (int i = 0; i < kLanes; ++i) {
    if (hits.geom[i] != last) {  // cache: most packets show few geoms
      last = hits.geom[i];
      id = last < 0 ? -1 : view.geoms[last].object_id;
      object = last < 0 ? -1 : view.geoms[last].object_type;
    }
    ids[i][0] = id;
    ids[i][1] = object;
  }
  write_pixels<2>(view.grid, x0, y0, ids[0], image);
}

inline void write_normals(const View& view, float* image, int x0, int y0, const Pixels& pixels,
                          const Hits& hits) {
  Surfaces surfaces;
  const std::uint32_t lanes = hit_lanes(hits);
  gather_surfaces(view, pixels, hits, lanes, false, surfaces);
  float normals[kLanes][3];
  for (int i = 0; i < kLanes; ++i)
    for (int c = 0; c < 3; ++c) normals[i][c] = lanes >> i & 1u ? surfaces.n[c][i] : 0.0f;
  write_pixels<3>(view.grid, x0, y0, normals[0], image);
}

inline void write_points(const View& view, float* image, int x0, int y0, const Pixels& pixels,
                         const Hits& hits) {
  const float nan = __builtin_nanf("");
  float points[kLanes][3];
  for (int i = 0; i < kLanes; ++i) {
    const bool hit = hits.geom[i] >= 0;
    const float s = view.grid.orthographic ? 1.0f : hits.t[i];
    points[i][0] = hit ? s * pixels.x[i] : nan;
    points[i][1] = hit ? s * pixels.y[i] : nan;
    points[i][2] = hit ? -hits.t[i] : nan;
  }
  write_pixels<3>(view.grid, x0, y0, points[0], image);
}

inline void write_geometry(const View& view, const ImageTargets& targets, int x0, int y0,
                           const Pixels& pixels, const Hits& hits) {
  if (targets.depth) write_depth(view, targets, x0, y0, pixels, hits);
  if (targets.segmentation) write_segmentation(view, targets.segmentation, x0, y0, hits);
  if (targets.normals) write_normals(view, targets.normals, x0, y0, pixels, hits);
  if (targets.points) write_points(view, targets.points, x0, y0, pixels, hits);
}

// Writes the linear radiance of a packet, before the tone mapping.
inline void write_hdr(float* image, const PixelGrid& grid, int x0, int y0,
                      const float (*rgb)[kLanes], float scale) {
  float values[kLanes][3];
  for (int i = 0; i < kLanes; ++i)
    for (int c = 0; c < 3; ++c) values[i][c] = scale * rgb[c][i];
  write_pixels<3>(grid, x0, y0, values[0], image);
}

// Packs two 24-bit pixels into 48 bits.
inline std::uint64_t close_up(const std::uint32_t* p) {
  constexpr std::uint64_t kLow = 0xffffff;
  const std::uint64_t both = p[0] | static_cast<std::uint64_t>(p[1]) << 32;
  return (both & kLow) | (both >> 8 & kLow << 24);
}

// Writes a packet's colours (0..1).
inline void write_rgb(const ImageTargets& targets, const PixelGrid& grid, int x0, int y0,
                      const float (*rgb)[kLanes], float scale) {
  alignas(64) std::uint32_t packed[kLanes];  // 0xbbggrr
  const Float full = splat(255.0f * scale), half = splat(0.5f);
  for (int k = 0; k < kLanes; k += kWidth) {
    Int bytes[3];
    for (int c = 0; c < 3; ++c) bytes[c] = truncate(fma(load(rgb[c] + k), full, half));
    store(reinterpret_cast<int*>(packed) + k,
          bytes[0] + int_of(256) * (bytes[1] + int_of(256) * bytes[2]));
  }
  const int columns = grid.width - x0 < 4 ? grid.width - x0 : 4;
  const int rows = grid.height - y0 < 4 ? grid.height - y0 : 4;
  for (int r = 0; r < rows; ++r) {
    std::uint8_t* out = targets.rgb + 3 * (static_cast<std::size_t>(y0 + r) * grid.width + x0);
    const std::uint32_t* p = packed + 4 * r;
    if (columns == 4) {  // twelve bytes, lowest first
      const std::uint64_t left = close_up(p), right = close_up(p + 2);
      const std::uint64_t words[2] = {left | right << 48, right >> 16};
      __builtin_memcpy(out, words, 12);
      continue;
    }
    for (int i = 0; i < columns; ++i)
      for (int c = 0; c < 3; ++c) out[3 * i + c] = static_cast<std::uint8_t>(p[i] >> 8 * c);
  }
}

}  // namespace
}  // namespace mjsense::render
