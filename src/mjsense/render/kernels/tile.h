// SPDX-License-Identifier: Apache-2.0
#pragma once
// Renders a tile of 16 x 16 pixels: finds the geoms it can see, the hit of each pixel, and its
// colour. Part of the tile kernels.

#include "mjsense/render/kernels/fixed.h"
#include "mjsense/render/kernels/layers.h"
#include "mjsense/render/kernels/output.h"
#include "mjsense/render/kernels/sky.h"

namespace mjsense {
namespace {

// Pixel offsets of a packet's lanes.
alignas(64) constexpr int kColumn[kLanes] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
alignas(64) constexpr int kRow[kLanes] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};

// Lanes outside the image repeat its border; they cost no extra work and are not written.
inline Int within(Int i, int size) { return select(less(i, int_of(size)), i, int_of(size - 1)); }

inline void fill_bent(const PixelGrid& grid, int x0, int y0, float shift_x, float shift_y,
                      Pixels& out) {
  float* w = out.window;
  w[0] = w[2] = kInfinity;
  w[1] = w[3] = -kInfinity;
  for (int i = 0; i < kLanes; ++i) {
    const int column = x0 + kColumn[i] < grid.width ? x0 + kColumn[i] : grid.width - 1;
    const int row = y0 + kRow[i] < grid.height ? y0 + kRow[i] : grid.height - 1;
    const float* ray = grid.bent + 2 * (row * grid.width + column);
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
  if (grid.bent) return fill_bent(grid, x0, y0, shift_x, shift_y, out);
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
  scratch.row_count = 0;
  for (int i = 0; i < view.num_opaque + view.num_transparent; ++i) {
    const float* w = view.geoms[i].window;
    if (grid.bent || (w[2] <= high && w[3] >= low)) scratch.row[scratch.row_count++] = i;
  }
}

inline TileLists find_geoms(const View& view, const float* window, TileScratch& scratch) {
  TileLists lists;
  for (int i = 0; i < scratch.row_count; ++i) {
    const int g = scratch.row[i];
    if (!overlap(view.geoms[g].window, window)) continue;
    if (g < view.num_opaque) {
      scratch.opaque[lists.opaque++] = g;
    } else {
      scratch.transparent[lists.transparent++] = g;
    }
  }
  return lists;
}

// Sample offsets within a pixel: Hammersley points, which are well spread in both directions.
inline void sample_shift(int index, int samples, float& x, float& y) {
  if (samples == 1) {
    x = y = 0;
    return;
  }
  std::uint32_t b = static_cast<std::uint32_t>(index);
  float radical = 0, half = 0.5f;
  for (; b; b >>= 1, half *= 0.5f) radical += (b & 1u) * half;
  x = (static_cast<float>(index) + 0.5f) / samples - 0.5f;
  y = radical + 0.5f / samples - 0.5f;
}

// Computes the colours of packet `q` before transparent geoms: surfaces, sky, reflections, haze.
inline void shade_packet(const View& view, const FixedTile* fixed, const Mirrored& mirrored, int q,
                         const Pixels& pixels, Hits& hits, Shadows& shadows, Colors& colors) {
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
    shade(view, surfaces, hits, lanes, view.shadows ? &shadows : nullptr, colors);
  }
  if (lanes != 0xffffu) shade_background(view, pixels, ~lanes & 0xffffu, colors);
  if (view.reflection) add_reflection(view, mirrored, q, colors);
  if (view.sky_distance > 0) add_haze(view, pixels, hits, colors);
}

// Work space of a thread; TileScratch::tile points to it.
struct TileSpace {
  Tile tile;
  Mirrored mirrored;
  Tile sampled[ImageTargets::kMostMultisamples];
};

// Sample offsets of OpenGL's multisampling: for four samples those that all common implementations
// use.
inline void multisample_shift(int index, int samples, float& x, float& y) {
  constexpr float kFour[4][2] = {{-1, -3}, {3, -1}, {-3, 1}, {1, 3}};
  if (samples != 4) return sample_shift(index, samples, x, y);
  x = kFour[index][0] / 8;
  y = -kFour[index][1] / 8;  // OpenGL counts rows from the bottom
}

// Sets the pixels of a tile at (x0, y0), `across` packets wide, and clears its hits.
inline void start_tile(const View& view, int x0, int y0, int across, int packets, float shift_x,
                       float shift_y, Tile& tile) {
  const float far = view.far > 0 ? view.far : kInfinity;
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

// Computes the colours of packet `q` with transparent geoms. `color`: where to store them.
inline void shade_pixels(const View& view, const FixedTile* fixed, const Mirrored& mirrored, int q,
                         const TileLists& lists, const TileScratch& scratch, Tile& tile,
                         Shadows& shadows, Colors& colors) {
  shade_packet(view, fixed, mirrored, q, tile.pixels[q], tile.hits[q], shadows, colors);
  if (lists.transparent)
    shade_transparent(view, scratch.transparent, lists.transparent, tile.pixels[q], tile.hits[q],
                      colors);
}

// If 1/t deviates from a linear function of the image by more than this times the size of a pixel,
// relative to 1/t, there is an edge within one geom.
constexpr float kBend = 0.06f;

// Packets that show an edge: neighbouring pixels see different geoms, or planes with different
// slopes. Geoms that are so thin that they may be between the centres of pixels are added.
inline PacketMask packets_with_edges(const View& view, const TileLists& lists, int across, int down,
                                     const TileScratch& scratch, Tile& tile) {
  constexpr int kSide = kTileSize;
  const PixelGrid& grid = view.grid;
  const int columns = 4 * across, rows = 4 * down;
  alignas(64) int geom[kSide * kSide];
  alignas(64) float nearness[kSide * kSide];
  for (int q = 0; q < across * down; ++q) {
    const int at = 4 * (q / across) * kSide + 4 * (q % across);
    for (int r = 0; r < 4; ++r)
      for (int i = 0; i < 4; ++i) {
        geom[at + r * kSide + i] = tile.hits[q].geom[4 * r + i];
        nearness[at + r * kSide + i] = 1 / tile.hits[q].t[4 * r + i];
      }
  }
  PacketMask edges = 0;
  const auto packet = [&](int x, int y) { return 1u << (y / 4 * across + x / 4); };
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      const int at = y * kSide + x;
      const auto look = [&](bool next, bool both, int step, int x2, int y2) {
        if (!next) return;
        if (geom[at] != geom[at + step]) {
          edges |= packet(x, y) | packet(x2, y2);
        } else if (both && geom[at] == geom[at - step]) {
          const float bend = nearness[at - step] + nearness[at + step] - 2 * nearness[at];
          if ((bend < 0 ? -bend : bend) > 4 * kBend * grid.dx * nearness[at])
            edges |= packet(x, y) | packet(x2, y2);
        }
      };
      look(x + 1 < columns, x > 0, 1, x + 1, y);
      look(y + 1 < rows, y > 0, kSide, x, y + 1);
    }
  const float thin = 2.5f * grid.dx, x = 0.5f * grid.dx, y = -0.5f * grid.dy;
  for (int i = 0; i < lists.opaque + lists.transparent; ++i) {
    const bool opaque = i < lists.opaque;
    const ViewGeom& g =
        view.geoms[opaque ? scratch.opaque[i] : scratch.transparent[i - lists.opaque]];
    const float* w = g.window;
    if (opaque && w[1] - w[0] > thin && w[3] - w[2] > thin) continue;
    const float window[4] = {w[0] - x, w[1] + x, w[2] - y, w[3] + y};
    edges |= packets_in_reach(window, g.nearest, tile);
  }
  return edges;
}

// Renders the tile as OpenGL does with multisampling: each pixel is shaded once, except where its
// samples see different surfaces.
inline void render_multisampled(const View& view, const ImageTargets& targets, int x0, int y0,
                                TileScratch& scratch) {
  auto& [tile, mirrored, sampled] = *static_cast<TileSpace*>(scratch.tile);
  const PixelGrid& grid = view.grid;
  const int across = (grid.width - x0 + 3) / 4 < kPackets ? (grid.width - x0 + 3) / 4 : kPackets;
  const int down = (grid.height - y0 + 3) / 4 < kPackets ? (grid.height - y0 + 3) / 4 : kPackets;
  const int packets = across * down, samples = targets.samples;
  constexpr float kReach = 0.5f;
  tile.shaded = true;
  start_tile(view, x0, y0, across, packets, 0, 0, tile);
  TileLists lists = find_geoms(view, tile.around, scratch);
  trace_tile(view, Part::kAll, scratch.opaque, lists.opaque, tile);
  Shadows shadows;
  if (view.shadows) find_all_casters(view, nullptr, tile, packets, scratch, shadows);
  if (view.reflection) look_through_mirror(view, packets, tile, mirrored);
  Colors centers[kTilePackets];
  PacketMask blended = 0;  // packets that are shaded for every sample
  for (int q = 0; q < packets; ++q) {
    shade_pixels(view, nullptr, mirrored, q, lists, scratch, tile, shadows, centers[q]);
    // Edges of what is reflected.
    if (view.reflection && mirrored.lanes[q] && hit_lanes(mirrored.tile.hits[q]))
      blended |= 1u << q;
  }
  // Geoms that only samples see are outside tile.around.
  float around[4];
  for (int c = 0; c < 4; ++c)
    around[c] = tile.around[c] + (c % 2 ? 1 : -1) * kReach * (c < 2 ? grid.dx : -grid.dy);
  lists = find_geoms(view, around, scratch);
  const PacketMask edges = packets_with_edges(view, lists, across, down, scratch, tile) | blended;
  for (int i = 0; i < lists.transparent; ++i)
    blended |= packets_in_reach(view.geoms[scratch.transparent[i]].window, 0, tile);
  if (edges) {
    alignas(64) float mean[kTilePackets][kLanes];
    std::uint32_t differ[kTilePackets] = {};
    for (int i = 0; i < samples; ++i) {
      Tile& t = sampled[i];
      t.shaded = true;
      float shift_x, shift_y;
      multisample_shift(i, samples, shift_x, shift_y);
      start_tile(view, x0, y0, across, packets, shift_x, shift_y, t);
      for (int q = 0; q < packets; ++q)
        if (!(edges >> q & 1u)) t.farthest[q] = -kInfinity;
      trace_tile(view, Part::kAll, scratch.opaque, lists.opaque, t);
      for (PacketMask rest = edges; rest; rest &= rest - 1) {
        const int q = __builtin_ctz(rest);
        for (int k = 0; k < kLanes; k += kWidth) {
          const Mask same = load(t.hits[q].geom + k) == load(tile.hits[q].geom + k);
          differ[q] |= (~bits(same) & kAllLanes) << k;
          const Float nearness = splat(1.0f / samples) / load(t.hits[q].t + k);
          store(mean[q] + k, i == 0 ? nearness : load(mean[q] + k) + nearness);
        }
      }
    }
    for (PacketMask rest = edges; rest; rest &= rest - 1) {
      const int q = __builtin_ctz(rest);
      for (int k = 0; k < kLanes; k += kWidth) {
        const Float nearness = splat(1.0f) / load(tile.hits[q].t + k);
        const Float bend = abs(load(mean[q] + k) - nearness);
        differ[q] |= bits(splat(kBend * grid.dx) * nearness < bend) << k;
      }
      if (blended >> q & 1u) differ[q] = 0xffffu;
      for (int k = 0; k < kLanes; k += kWidth) {
        const Mask keep = mask_of(~differ[q] >> k & kAllLanes);
        for (auto& c : centers[q].rgb) store(c + k, select(keep, load(c + k), splat(0.0f)));
      }
    }
    for (int i = 0; i < samples; ++i) {
      Tile& t = sampled[i];
      PacketMask shaded = 0;
      for (PacketMask rest = edges; rest; rest &= rest - 1) {
        const int q = __builtin_ctz(rest);
        if (!differ[q]) continue;
        shaded |= 1u << q;
        for (int k = 0; k < kLanes; ++k)
          if (!(differ[q] >> k & 1u)) {
            t.hits[q].t[k] = kInfinity;
            t.hits[q].geom[k] = t.hits[q].id[k] = -1;
          }
      }
      if (!shaded) break;
      for (int q = 0; q < packets; ++q)
        if (!(shaded >> q & 1u)) clear(t.hits[q], kInfinity);
      if (view.shadows) find_all_casters(view, nullptr, t, packets, scratch, shadows);
      if (view.reflection) look_through_mirror(view, packets, t, mirrored);
      for (; shaded; shaded &= shaded - 1) {
        const int q = __builtin_ctz(shaded);
        Colors colors;
        shade_pixels(view, nullptr, mirrored, q, lists, scratch, t, shadows, colors);
        for (int k = 0; k < kLanes; k += kWidth) {
          const Mask add = mask_of(differ[q] >> k & kAllLanes);
          for (int c = 0; c < 3; ++c)
            store(centers[q].rgb[c] + k,
                  load(centers[q].rgb[c] + k) +
                      select(add, load(colors.rgb[c] + k) * splat(1.0f / samples), splat(0.0f)));
        }
      }
    }
  }
  for (int q = 0; q < packets; ++q)
    write_rgb(targets, grid, x0 + 4 * (q % across), y0 + 4 * (q / across), centers[q].rgb, 1);
}

inline void render_tile(const View& view, const ImageTargets& targets, int tx, int ty,
                        TileScratch& scratch) {
  auto& [tile, mirrored, sampled] = *static_cast<TileSpace*>(scratch.tile);
  const PixelGrid& grid = view.grid;
  const int x0 = tx * kTileSize, y0 = ty * kTileSize;
  const int across = (grid.width - x0 + 3) / 4 < kPackets ? (grid.width - x0 + 3) / 4 : kPackets;
  const int down = (grid.height - y0 + 3) / 4 < kPackets ? (grid.height - y0 + 3) / 4 : kPackets;
  const int packets = across * down;
  const bool geometry = targets.depth || targets.segmentation || targets.normals || targets.points;
  tile.shaded = targets.rgb || targets.normals || targets.fixed;
  const int samples = targets.rgb ? targets.samples : 1;
  alignas(64) float sum[kTilePackets][3][kLanes];
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
      trace_tile(view, Part::kAll, scratch.opaque, lists.opaque, tile);
    } else {
      const int at = ty * ((grid.width + kTileSize - 1) / kTileSize) + tx;
      if (targets.fixed) {
        make_fixed(view, lists.opaque, packets, tile, scratch, targets.fixed[at]);
        return;
      }
      if (view.fixed) {
        fixed = view.fixed + at;
        load_fixed(view, *fixed, packets, tile);
        if (targets.normals)
          for (int q = 0; q < packets; ++q) load_rest(*fixed, q, 0xffffu, tile.hits[q]);
      } else {  // same order as with a cached layer, so that the pixels are identical
        trace_tile(view, Part::kFixed, scratch.opaque, lists.opaque, tile);
      }
      trace_tile(view, Part::kMoving, scratch.opaque, lists.opaque, tile);
    }
    if (targets.rgb && sample < samples) {
      Shadows shadows;
      if (view.shadows) find_all_casters(view, fixed, tile, packets, scratch, shadows);
      if (view.reflection) look_through_mirror(view, packets, tile, mirrored);
      for (int q = 0; q < packets; ++q) {
        Colors colors;
        shade_pixels(view, fixed, mirrored, q, lists, scratch, tile, shadows, colors);
        for (int c = 0; c < 3; ++c)
          for (int k = 0; k < kLanes; k += kWidth) {
            const Float color = load(colors.rgb[c] + k);
            store(sum[q][c] + k, sample == 0 ? color : color + load(sum[q][c] + k));
          }
      }
    }
    if (geometry && centered) {
      trace_transparent(view, scratch.transparent, lists.transparent, tile);
      for (int q = 0; q < packets; ++q) {
        write_geometry(view, targets, x0 + 4 * (q % across), y0 + 4 * (q / across), tile.pixels[q],
                       tile.hits[q]);
      }
    }
  }
  if (!targets.rgb) return;
  for (int q = 0; q < packets; ++q)
    write_rgb(targets, grid, x0 + 4 * (q % across), y0 + 4 * (q / across), sum[q], 1.0f / samples);
}

inline void render_tiles(const View& view, const ImageTargets& targets, int first, int last,
                         TileScratch& scratch) {
  const int across = (view.grid.width + kTileSize - 1) / kTileSize;
  for (int ty = first; ty < last; ++ty) {
    find_row(view, ty, scratch);
    for (int tx = 0; tx < across; ++tx) {
      if (targets.multisampled) {
        render_multisampled(view, targets, tx * kTileSize, ty * kTileSize, scratch);
      } else {
        render_tile(view, targets, tx, ty, scratch);
      }
    }
  }
}

}  // namespace
}  // namespace mjsense
