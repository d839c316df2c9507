// SPDX-License-Identifier: Apache-2.0
#pragma once
// Renders a tile of 16 x 16 pixels: finds the geoms it can see, the hit of each pixel, and its
// colour. Part of the tile kernels.

#include "mjsense/render/kernels/edges.h"
#include "mjsense/render/kernels/output.h"
#include "mjsense/render/kernels/sky.h"
#include "mjsense/render/kernels/tile_fixed_layer.h"
#include "mjsense/render/kernels/transparency.h"

namespace mjsense::render {
namespace {

// Pixel offsets of a packet's lanes.
alignas(64) constexpr int kColumn[kLanes] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
alignas(64) constexpr int kRow[kLanes] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};

// Lanes outside the image repeat its border; they cost no extra work and are not written.
inline Int within(Int i, int size) { return select(less(i, int_of(size)), i, int_of(size - 1)); }

inline void fill_distorted(const PixelGrid& grid, int x0, int y0, float shift_x, float shift_y,
                           Pixels& out) {
  float* w = out.window;
  w[0] = w[2] = kInfinity;
  w[1] = w[3] = -kInfinity;
  for (int i = 0; i < kLanes; ++i) {
    const int column = x0 + kColumn[i] < grid.width ? x0 + kColumn[i] : grid.width - 1;
    const int row = y0 + kRow[i] < grid.height ? y0 + kRow[i] : grid.height - 1;
    const float* ray = grid.distorted_rays + 2 * (row * grid.width + column);
    const float px = out.x[i] = ray[0] + shift_x * grid.dx;
    const float py = out.y[i] = ray[1] + shift_y * grid.dy;
    w[0] = px < w[0] ? px : w[0];
    w[1] = px > w[1] ? px : w[1];
    w[2] = py < w[2] ? py : w[2];
    w[3] = py > w[3] ? py : w[3];
  }
}

inline void fill_pixels(const View& view, int x0, int y0, float shift_x, float shift_y,
                        Pixels& out) {
  const PixelGrid& grid = view.grid;
  for (int k = 0; k < kLanes; k += kWidth) store(out.near + k, splat(view.near));
  if (grid.distorted_rays) return fill_distorted(grid, x0, y0, shift_x, shift_y, out);
  const auto place = [](float first, float step, Int i, float shift) {
    return splat(first) + splat(step) * (to_float(i) + splat(0.5f + shift));
  };
  for (int k = 0; k < kLanes; k += kWidth) {
    const Int column = within(int_of(x0) + load(kColumn + k), grid.width);
    const Int row = within(int_of(y0) + load(kRow + k), grid.height);
    store(out.x + k, place(grid.left, grid.dx, column, shift_x));
    store(out.y + k, place(grid.top, grid.dy, row, shift_y));
  }
  out.window[0] = out.x[0];
  out.window[1] = out.x[3];
  out.window[2] = out.y[kLanes - 1];
  out.window[3] = out.y[0];
}

struct TileLists {
  int opaque = 0, transparent = 0;
};

// Finds the geoms that a row of tiles may show. With lens distortion, rows are curved; then all
// visible geoms are listed.
inline void find_row(const View& view, int ty, TileScratch& scratch) {
  const PixelGrid& grid = view.grid;
  const float top = grid.top + grid.dy * static_cast<float>(ty * kTileSize);
  const float reach = 0.5f * grid.dy;  // of samples
  const float high = top - reach, low = top + grid.dy * kTileSize + reach;
  scratch.num_row_geoms = 0;
  for (int i = 0; i < view.num_opaque + view.num_transparent; ++i) {
    const float* w = view.geoms[i].window;
    if (grid.distorted_rays || (w[2] <= high && w[3] >= low))
      scratch.row_geoms[scratch.num_row_geoms++] = i;
  }
}

inline TileLists find_geoms(const View& view, const float* window, TileScratch& scratch) {
  TileLists lists;
  for (int i = 0; i < scratch.num_row_geoms; ++i) {
    const int g = scratch.row_geoms[i];
    if (!overlap(view.geoms[g].window, window)) continue;
    if (g < view.num_opaque) {
      scratch.opaque_geoms[lists.opaque++] = g;
    } else {
      scratch.transparent_geoms[lists.transparent++] = g;
    }
  }
  return lists;
}

// Computes the colours of packet `q` before transparent geoms: surfaces, sky, reflections, haze.
inline void shade_packet(const View& view, const FixedTile* fixed, const Reflection& reflection,
                         int q, const Pixels& pixels, Hits& hits, Shadows& shadows,
                         Colors& colors) {
  const std::uint32_t lanes = hit_lanes(hits);
  shadows.packet = q;
  shadows.settled = false;
  if (fixed) shadows.fixed_lanes = fixed_lanes(*fixed, q, hits);
  const bool kept =
      lanes && fixed && load_colors(view, *fixed, pixels, hits, lanes, shadows, colors);
  if (lanes && !kept) {
    if (fixed) load_rest(*fixed, q, shadows.fixed_lanes, hits);
    Surfaces surfaces;
    gather_surfaces(view, pixels, hits, lanes, true, surfaces);
    shade(view, surfaces, hits, lanes, needs_others(view) ? &shadows : nullptr, colors);
  }
  if (lanes != 0xffffu) shade_background(view, pixels, ~lanes & 0xffffu, colors);
  if (view.reflection) add_reflection(view, reflection, q, colors);
  if (view.sky_distance > 0) add_haze(view, pixels, hits, colors);
}

// Number of the tile at pixel (x0, y0).
inline int tile_index(const PixelGrid& grid, int x0, int y0) {
  return y0 / kTileSize * ((grid.width + kTileSize - 1) / kTileSize) + x0 / kTileSize;
}

// Work space of a thread; TileScratch::tile points to it.
struct TileSpace {
  Tile tile;
  Reflection reflection;
  Tile sampled;
  KeptTriangles triangles;
};

// Sets the pixels of a tile at (x0, y0), `across` packets wide, and clears its hits.
inline void start_tile(const View& view, int x0, int y0, int across, int packets, float shift_x,
                       float shift_y, Tile& tile) {
  const float far = view.far > 0 ? view.far : kInfinity;
  tile.regular = true;
  tile.keep = nullptr;
  tile.kept = nullptr;
  float* window = tile.around;
  window[0] = window[2] = kInfinity;
  window[1] = window[3] = -kInfinity;
  for (int q = 0; q < packets; ++q) {
    fill_pixels(view, x0 + 4 * (q % across), y0 + 4 * (q / across), shift_x, shift_y,
                tile.pixels[q]);
    const float* w = tile.pixels[q].window;
    for (int c = 0; c < 4; c += 2) {
      window[c] = w[c] < window[c] ? w[c] : window[c];
      window[c + 1] = w[c + 1] > window[c + 1] ? w[c + 1] : window[c + 1];
    }
    for (int c = 0; c < 4; ++c) tile.window[c][q] = w[c];
    tile.farthest[q] = far;
    clear(tile.hits[q], far);
  }
  for (int q = packets; q < kTilePackets; ++q) tile.farthest[q] = -kInfinity;
  tile.depth = far;
}

// Computes the colours of packet `q` with transparent geoms. `radiance`: null, or what gets their
// values before the tone mapping.
inline void shade_pixels(const View& view, const FixedTile* fixed, const Reflection& reflection,
                         int q, const TileLists& lists, const TileScratch& scratch, Tile& tile,
                         Shadows& shadows, Colors& colors, Colors* radiance = nullptr) {
  shade_packet(view, fixed, reflection, q, tile.pixels[q], tile.hits[q], shadows, colors);
  if (lists.transparent)
    shade_transparent(view, scratch.transparent_geoms, lists.transparent, tile.pixels[q],
                      tile.hits[q], colors);
  if (radiance)
    for (int c = 0; c < 3; ++c) copy_lanes(colors.rgb[c], radiance->rgb[c]);
  if (view.physical.on) map_tones(view.physical, colors);
}

// Replaces the colours of the pixels by the means of their samples. A pixel all of whose samples see
// the surface of its centre keeps its colour, unless it is among the lanes `always` of its packet.
inline void shade_samples(const View& view, const TileLists& lists, const std::uint32_t* always,
                          SampledPixels& pixels, TileScratch& scratch, TileBox* receivers,
                          Colors* colors) {
  auto& [centers, reflection, tile, triangles] = *static_cast<TileSpace*>(scratch.tile);
  start_samples(view, centers, pixels, tile);
  tile.kept = &triangles;
  trace_tile(view, Part::kAll, scratch.opaque_geoms, lists.opaque, tile);
  tile.kept = nullptr;
  keep_differing(view, centers, always, pixels, tile);
  if (!pixels.count) return;
  const int packets = pixels.packets(), samples = pixels.samples;
  const float part = 1.0f / samples;
  Shadows shadows;
  if (needs_others(view))
    find_all_casters(view, nullptr, tile, packets, scratch, shadows, receivers);
  if (view.reflection) trace_reflection(view, packets, tile, reflection);
  for (int q = 0; q < packets; ++q) {
    Colors sampled;
    shade_pixels(view, nullptr, reflection, q, lists, scratch, tile, shadows, sampled);
    for (int k = 0; k < kLanes && q * kLanes + k < pixels.count * samples; k += samples) {
      const int pixel = pixels.pixel(q, k);
      for (int c = 0; c < 3; ++c) {
        float sum = 0;
        for (int i = k; i < k + samples; ++i) sum += sampled.rgb[c][i];
        colors[pixels.packet[pixel]].rgb[c][pixels.lane[pixel]] = sum * part;
      }
    }
  }
}

// Adds the lanes of each packet that show an edge in the mirror.
inline void find_reflected_edges(const View& beyond, const Reflection& reflection, int across,
                                 int down, std::uint32_t* edges) {
  find_edges(beyond.grid, reflection.tile.hits, across, down, edges);
  for (int i = 0; i < beyond.num_opaque; ++i)
    add_thin(beyond.grid, beyond.geoms[i], reflection.tile, edges);
  for (int q = 0; q < across * down; ++q) edges[q] &= reflection.lanes[q];
}

// Adds the lanes of each packet that show an edge of transparent geom `index`. `layer`: working
// memory for the hits of the tile.
inline void find_transparent_edges(const View& view, int index, const Tile& tile, int across,
                                   int down, Hits* layer, std::uint32_t* edges) {
  const ViewGeom& g = view.geoms[index];
  const PacketMask near = packets_in_reach(g.window, g.min_depth, tile);
  if (!near) return;
  for (int q = 0; q < across * down; ++q) {
    clear(layer[q], kInfinity);
    if (near >> q & 1u) copy_lanes(tile.hits[q].t, layer[q].t);
  }
  if (trace_geom(view, index, tile.pixels, layer, near)) {
    for (int q = 0; q < across * down; ++q)
      for (int k = 0; k < kLanes; k += kWidth)
        store(layer[q].t + k, select(less(int_of(-1), load(layer[q].geom + k)),
                                     load(layer[q].t + k), splat(kInfinity)));
    find_edges(view.grid, layer, across, down, edges);
  }
  add_thin(view.grid, g, tile, edges);
}

// Renders the tile as OpenGL does with multisampling: each pixel is shaded once, except where its
// samples see different surfaces.
inline void render_multisampled(const View& view, const ImageTargets& targets, int x0, int y0,
                                TileScratch& scratch) {
  auto& [tile, reflection, sampled, triangles] = *static_cast<TileSpace*>(scratch.tile);
  const PixelGrid& grid = view.grid;
  const int across = (grid.width - x0 + 3) / 4 < kPackets ? (grid.width - x0 + 3) / 4 : kPackets;
  const int down = (grid.height - y0 + 3) / 4 < kPackets ? (grid.height - y0 + 3) / 4 : kPackets;
  const int packets = across * down;
  tile.shaded = true;
  start_tile(view, x0, y0, across, packets, 0, 0, tile);
  // Samples are up to half a pixel outside tile.around.
  for (int c = 0; c < 4; ++c)
    tile.reach[c] = tile.around[c] + (c % 2 ? 0.5f : -0.5f) * (c < 2 ? grid.dx : -grid.dy);
  const TileLists lists = find_geoms(view, tile.reach, scratch);
  triangles.clear();
  tile.keep = &triangles;
  trace_tile(view, Part::kAll, scratch.opaque_geoms, lists.opaque, tile);
  tile.keep = nullptr;
  Shadows shadows;
  TileBox* const receivers =
      targets.receivers ? targets.receivers + tile_index(grid, x0, y0) : nullptr;
  if (needs_others(view))
    find_all_casters(view, nullptr, tile, packets, scratch, shadows, receivers);
  std::uint32_t edges[kTilePackets] = {};
  find_edges(grid, tile.hits, across, down, edges);
  for (int i = 0; i < lists.opaque; ++i)
    add_thin(grid, view.geoms[scratch.opaque_geoms[i]], tile, edges);
  std::uint32_t always[kTilePackets] = {};
  if (view.reflection && trace_reflection(view, packets, tile, reflection))
    find_reflected_edges(*view.reflection, reflection, across, down, always);
  for (int i = 0; i < lists.transparent; ++i)
    find_transparent_edges(view, scratch.transparent_geoms[i], tile, across, down, sampled.hits,
                           always);
  Colors colors[kTilePackets];
  for (int q = 0; q < packets; ++q) {
    shade_pixels(view, nullptr, reflection, q, lists, scratch, tile, shadows, colors[q]);
    edges[q] |= always[q];
  }
  SampledPixels pixels{.samples = targets.samples};
  for (int q = 0; q < packets; ++q) {
    for (std::uint32_t lanes = edges[q]; lanes; lanes &= lanes - 1) {
      pixels.packet[pixels.count] = q;
      pixels.lane[pixels.count++] = __builtin_ctz(lanes);
      if (pixels.count < pixels.maximum()) continue;
      shade_samples(view, lists, always, pixels, scratch, receivers, colors);
      pixels.count = 0;
    }
  }
  if (pixels.count) shade_samples(view, lists, always, pixels, scratch, receivers, colors);
  for (int q = 0; q < packets; ++q)
    write_rgb(targets, grid, x0 + 4 * (q % across), y0 + 4 * (q / across), colors[q].rgb, 1);
}

inline void render_tile(const View& view, const ImageTargets& targets, int tx, int ty,
                        TileScratch& scratch) {
  auto& [tile, reflection, sampled, triangles] = *static_cast<TileSpace*>(scratch.tile);
  const PixelGrid& grid = view.grid;
  const int x0 = tx * kTileSize, y0 = ty * kTileSize;
  const int across = (grid.width - x0 + 3) / 4 < kPackets ? (grid.width - x0 + 3) / 4 : kPackets;
  const int down = (grid.height - y0 + 3) / 4 < kPackets ? (grid.height - y0 + 3) / 4 : kPackets;
  const int packets = across * down;
  const bool geometry = targets.depth || targets.segmentation || targets.normals || targets.points;
  const bool colored = targets.rgb || targets.hdr;
  tile.shaded = colored || targets.normals || targets.fixed_tiles;
  const int samples = colored ? targets.samples : 1;
  TileBox* const receivers =
      targets.receivers ? targets.receivers + tile_index(grid, x0, y0) : nullptr;
  alignas(64) float sum[kTilePackets][3][kLanes], radiance_sum[kTilePackets][3][kLanes];
  for (int sample = 0; sample < samples || (sample == samples && samples > 1 && geometry);
       ++sample) {
    // The last round, if present, is for depth and segmentation: its rays pass through the pixel
    // centres.
    const bool centered = sample == samples || samples == 1;
    float shift_x = 0, shift_y = 0;
    if (!centered) sample_shift(sample, samples, shift_x, shift_y);
    start_tile(view, x0, y0, across, packets, shift_x, shift_y, tile);
    const TileLists lists = find_geoms(view, tile.around, scratch);
    const FixedTile* fixed = nullptr;  // the tile's cached layer
    if (!view.layered || samples > 1) {
      trace_tile(view, Part::kAll, scratch.opaque_geoms, lists.opaque, tile);
    } else {
      const int at = tile_index(grid, x0, y0);
      if (targets.fixed_tiles) {
        make_fixed(view, lists.opaque, packets, tile, scratch, targets.fixed_tiles[at]);
        return;
      }
      if (view.fixed_tiles) {
        fixed = view.fixed_tiles + at;
        load_fixed(view, *fixed, packets, tile);
        if (targets.normals)
          for (int q = 0; q < packets; ++q) load_rest(*fixed, q, 0xffffu, tile.hits[q]);
      } else {  // same order as with a cached layer, so that the pixels are identical
        trace_tile(view, Part::kFixed, scratch.opaque_geoms, lists.opaque, tile);
      }
      trace_tile(view, Part::kMoving, scratch.opaque_geoms, lists.opaque, tile);
    }
    if (colored && sample < samples) {
      Shadows shadows;
      if (needs_others(view))
        find_all_casters(view, fixed, tile, packets, scratch, shadows, receivers);
      if (view.reflection) trace_reflection(view, packets, tile, reflection);
      for (int q = 0; q < packets; ++q) {
        Colors colors, radiance;
        shade_pixels(view, fixed, reflection, q, lists, scratch, tile, shadows, colors,
                     targets.hdr ? &radiance : nullptr);
        const auto add = [&](const Colors& more, float(*total)[kLanes]) {
          for (int c = 0; c < 3; ++c)
            for (int k = 0; k < kLanes; k += kWidth) {
              const Float color = load(more.rgb[c] + k);
              store(total[c] + k, sample == 0 ? color : color + load(total[c] + k));
            }
        };
        add(colors, sum[q]);
        if (targets.hdr) add(radiance, radiance_sum[q]);
      }
    }
    if (geometry && centered) {
      trace_transparent(view, scratch.transparent_geoms, lists.transparent, tile);
      for (int q = 0; q < packets; ++q) {
        write_geometry(view, targets, x0 + 4 * (q % across), y0 + 4 * (q / across), tile.pixels[q],
                       tile.hits[q]);
      }
    }
  }
  for (int q = 0; q < packets; ++q) {
    const int x = x0 + 4 * (q % across), y = y0 + 4 * (q / across);
    if (targets.rgb) write_rgb(targets, grid, x, y, sum[q], 1.0f / samples);
    if (targets.hdr)
      write_hdr(targets.hdr, grid, x, y, radiance_sum[q], view.physical.white_radiance / samples);
  }
}

inline void render_tiles(const View& view, const ImageTargets& targets, int first, int last,
                         TileScratch& scratch) {
  const int across = (view.grid.width + kTileSize - 1) / kTileSize;
  for (int ty = first; ty < last; ++ty) {
    find_row(view, ty, scratch);
    for (int tx = 0; tx < across; ++tx) {
      if (targets.changed_tiles && !targets.changed_tiles[ty * across + tx]) continue;
      if (targets.multisampled) {
        render_multisampled(view, targets, tx * kTileSize, ty * kTileSize, scratch);
      } else {
        render_tile(view, targets, tx, ty, scratch);
      }
    }
  }
}

}  // namespace
}  // namespace mjsense::render
