// SPDX-License-Identifier: Apache-2.0
#pragma once
// Samples within pixels: their places, the pixels of a tile that show an edge, and tiles whose lanes
// are the samples of such pixels. Part of the tile kernels.

#include "mjsense/render/kernels/trace.h"
#include "mjsense/render/view/image_window.h"

namespace mjsense::render {
namespace {

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

// Sample offsets of OpenGL's multisampling: for four samples those that all common implementations
// use.
inline void multisample_shift(int index, int samples, float& x, float& y) {
  constexpr float kFour[4][2] = {{-1, -3}, {3, -1}, {-3, 1}, {1, 3}};
  if (samples != 4) return sample_shift(index, samples, x, y);
  x = kFour[index][0] / 8;
  y = -kFour[index][1] / 8;  // OpenGL counts rows from the bottom
}

// Within one geom, there is an edge where 1/t is not a linear function of the image. Two tests find
// it, with limits relative to 1/t and to the size of a pixel. Before a pixel is sampled, the second
// difference of 1/t between it and its neighbours must exceed kBendToNeighbors. The samples are used
// if their mean differs from the centre by more than kBend. A crease in the pixel makes that
// difference an eighth of the second difference at most, so the first limit is the larger one.
constexpr float kBend = 0.06f, kBendToNeighbors = 5 * kBend;

// A value of each pixel of a tile, row by row, with one pixel more at each side.
struct alignas(64) PaddedTile {
  static constexpr int kStride =
      3 * kTileSize;  // between rows, which start at a multiple of 64 bytes
  float values[(kTileSize + 2) * kStride];

  float* row(int y) { return values + (y + 1) * kStride + kTileSize; }
  void set(int packet, int across, const float* lanes) {
    for (int r = 0; r < 4; ++r)
      __builtin_memcpy(row(4 * (packet / across) + r) + 4 * (packet % across), lanes + 4 * r,
                       4 * sizeof(float));
  }
  // Continues the tile beyond its border: `slope` 0 repeats the border, 1 extrapolates linearly.
  void pad(int columns, int rows, float slope) {
    for (int y = 0; y < rows; ++y) {
      float *first = row(y), *last = first + columns - 1;
      first[-1] = first[0] + slope * (first[0] - first[1]);
      last[1] = last[0] + slope * (last[0] - last[-1]);
    }
    const auto beyond = [&](float* out, const float* border, const float* inner) {
      for (int k = 0; k < kTileSize; k += kWidth)
        store(out + k, fma(splat(slope), load(border + k) - load(inner + k), load(border + k)));
    };
    beyond(row(-1), row(0), row(1));
    beyond(row(rows), row(rows - 1), row(rows - 2));
  }
};

// Adds the lanes of each packet that show an edge: neighbouring pixels see different geoms, or planes
// with different slopes.
inline void find_edges(const PixelGrid& grid, const Hits* hits, int across, int down,
                       std::uint32_t* edges) {
  PaddedTile geoms, nearness;
  for (int q = 0; q < across * down; ++q) {
    alignas(64) float geom[kLanes], inverse[kLanes];
    for (int k = 0; k < kLanes; k += kWidth) {
      store(geom + k, to_float(load(hits[q].geom + k)));
      store(inverse + k, splat(1.0f) / load(hits[q].t + k));
    }
    geoms.set(q, across, geom);
    nearness.set(q, across, inverse);
  }
  const int columns = 4 * across, rows = 4 * down;
  geoms.pad(columns, rows, 0);
  nearness.pad(columns, rows, 1);
  const Float maximum = splat(kBendToNeighbors * grid.dx);
  for (int y = 0; y < rows; ++y) {
    std::uint32_t found = 0;
    for (int k = 0; k < kTileSize; k += kWidth) {
      const float *geom = geoms.row(y) + k, *inverse = nearness.row(y) + k;
      const Float id = load(geom), here = load(inverse), limit = maximum * here;
      Mask edge = mask_of(0);
      for (int step : {1, PaddedTile::kStride}) {
        const Float before = loadu(geom - step), after = loadu(geom + step);
        const Float bend = loadu(inverse - step) + loadu(inverse + step) - splat(2.0f) * here;
        edge = edge | (before < id) | (id < before) | (after < id) | (id < after) |
               (limit < abs(bend));
      }
      found |= bits(edge) << k;
    }
    for (int i = 0; i < across; ++i)
      edges[y / 4 * across + i] |= (found >> 4 * i & 0xfu) << (y % 4 * 4);
  }
}

// If the geom is thin (kThin), adds all lanes of the packets near its window.
inline void add_thin(const PixelGrid& grid, const ViewGeom& g, const Tile& tile,
                     std::uint32_t* edges) {
  const float thin = kThin * grid.dx, x = 0.5f * grid.dx, y = -0.5f * grid.dy;
  const float* w = g.window;
  if (w[1] - w[0] > thin && w[3] - w[2] > thin) return;
  const float window[4] = {w[0] - x, w[1] + x, w[2] - y, w[3] + y};
  for (PacketMask near = packets_in_reach(window, g.min_depth, tile); near; near &= near - 1)
    edges[__builtin_ctz(near)] = 0xffffu;
}

// Both functions work on lanes of one pixel, whose number is a power of two.
template <typename T>
void fill(T* p, int count, T value) {
  if (count < 4) {
    for (int i = 0; i < count; ++i) p[i] = value;
    return;
  }
  const T four[4] = {value, value, value, value};
  for (int i = 0; i < count; i += 4) __builtin_memcpy(p + i, four, sizeof four);
}
template <typename T>
void copy(const T* from, int count, T* to) {
  if (count < 4) {
    for (int i = 0; i < count; ++i) to[i] = from[i];
    return;
  }
  for (int i = 0; i < count; i += 4) __builtin_memcpy(to + i, from + i, 4 * sizeof(T));
}

// Pixels of a tile, each of which has `samples` lanes in a tile of samples.
struct SampledPixels {
  int samples;
  int packet[kTilePackets * kLanes], lane[kTilePackets * kLanes];  // of each pixel
  int count = 0;

  int maximum() const { return kTilePackets * kLanes / samples; }
  int packets() const { return (count * samples + kLanes - 1) / kLanes; }
  // The pixel of the lanes from k on; lanes that are not used repeat the last pixel.
  int pixel(int q, int k) const {
    const int i = (q * kLanes + k) >> __builtin_ctz(samples);
    return i < count ? i : count - 1;
  }
};

// Sets the window of packet `q` to that of its lanes.
inline void set_window(Tile& tile, int q) {
  Pixels& p = tile.pixels[q];
  const float* places[2] = {p.x, p.y};
  for (int axis = 0; axis < 2; ++axis) {
    Float low = splat(kInfinity), high = splat(-kInfinity);
    for (int k = 0; k < kLanes; k += kWidth) {
      low = min(low, load(places[axis] + k));
      high = max(high, load(places[axis] + k));
    }
    p.window[2 * axis] = tile.window[2 * axis][q] = lane_min(low);
    p.window[2 * axis + 1] = tile.window[2 * axis + 1][q] = lane_max(high);
  }
}

// Starts a tile whose lanes are the samples of the pixels.
inline void start_samples(const View& view, const Tile& centers, const SampledPixels& pixels,
                          Tile& out) {
  const int packets = pixels.packets(), samples = pixels.samples;
  const float far = view.far > 0 ? view.far : kInfinity;
  alignas(64) float shift_x[kLanes], shift_y[kLanes];
  for (int k = 0; k < kLanes; ++k) multisample_shift(k % samples, samples, shift_x[k], shift_y[k]);
  out.shaded = true;
  out.regular = false;
  out.keep = nullptr;
  out.around[0] = out.around[2] = kInfinity;
  out.around[1] = out.around[3] = -kInfinity;
  for (int q = 0; q < packets; ++q) {
    Pixels& p = out.pixels[q];
    for (int k = 0; k < kLanes; k += samples) {
      const int i = pixels.pixel(q, k);
      const Pixels& from = centers.pixels[pixels.packet[i]];
      fill(p.x + k, samples, from.x[pixels.lane[i]]);
      fill(p.y + k, samples, from.y[pixels.lane[i]]);
    }
    for (int k = 0; k < kLanes; k += kWidth) {
      const Float x = fma(load(shift_x + k), splat(view.grid.dx), load(p.x + k));
      const Float y = fma(load(shift_y + k), splat(view.grid.dy), load(p.y + k));
      store(p.x + k, x);
      store(p.y + k, y);
      store(p.near + k, splat(view.near));
    }
    set_window(out, q);
    for (int c = 0; c < 4; c += 2) {
      out.around[c] = p.window[c] < out.around[c] ? p.window[c] : out.around[c];
      out.around[c + 1] = p.window[c + 1] > out.around[c + 1] ? p.window[c + 1] : out.around[c + 1];
    }
    out.farthest[q] = far;
    clear(out.hits[q], far);
  }
  for (int q = packets; q < kTilePackets; ++q) out.farthest[q] = -kInfinity;
  out.depth = far;
}

// Copies `count` lanes of a packet from lane `k` on to lane `to_k` of another.
inline void copy_lanes(const Pixels& pixels, const Hits& hits, int k, int count, Pixels& to,
                       Hits& to_hits, int to_k) {
  copy(pixels.x + k, count, to.x + to_k);
  copy(pixels.y + k, count, to.y + to_k);
  copy(hits.t + k, count, to_hits.t + to_k);
  copy(hits.id + k, count, to_hits.id + to_k);
  copy(hits.geom + k, count, to_hits.geom + to_k);
  copy(hits.prim + k, count, to_hits.prim + to_k);
  copy(hits.u + k, count, to_hits.u + to_k);
  copy(hits.v + k, count, to_hits.v + to_k);
  for (int c = 0; c < 3; ++c) copy(hits.n[c] + k, count, to_hits.n[c] + to_k);
}

// Removes the pixels all of whose samples see the surface of the centre, unless they are among the
// lanes `always` of their packets, and moves the samples of the others to the first lanes.
inline void keep_differing(const View& view, const Tile& centers, const std::uint32_t* always,
                           SampledPixels& pixels, Tile& tile) {
  const int samples = pixels.samples, packets = pixels.packets();
  const float maximum = kBend * view.grid.dx, part = 1.0f / samples;
  int kept = 0;  // pixels
  for (int q = 0; q < packets; ++q) {
    const Hits& hits = tile.hits[q];
    alignas(64) float nearness[kLanes];
    for (int k = 0; k < kLanes; k += kWidth) store(nearness + k, splat(1.0f) / load(hits.t + k));
    for (int k = 0; k < kLanes; k += samples) {
      const int i = q * (kLanes / samples) + k / samples;
      if (i >= pixels.count) break;
      const int packet = pixels.packet[i], lane = pixels.lane[i];
      const int geom = centers.hits[packet].geom[lane];
      const float center = 1 / centers.hits[packet].t[lane];
      bool differs = always[packet] >> lane & 1u;
      float mean = 0;
      for (int j = k; j < k + samples; ++j) {
        mean += nearness[j];
        differs |= hits.geom[j] != geom;
      }
      const float bend = mean * part - center;
      if (!differs && (bend < 0 ? -bend : bend) <= maximum * center) continue;
      if (const int to = kept * samples; kept < i)
        copy_lanes(tile.pixels[q], hits, k, samples, tile.pixels[to / kLanes],
                   tile.hits[to / kLanes], to % kLanes);
      pixels.packet[kept] = packet;
      pixels.lane[kept++] = lane;
    }
  }
  pixels.count = kept;
  for (int k = kept * samples; k < pixels.packets() * kLanes; ++k) {
    Hits& hits = tile.hits[k / kLanes];
    hits.t[k % kLanes] = kInfinity;
    hits.id[k % kLanes] = hits.geom[k % kLanes] = -1;
  }
  for (int q = 0; q < pixels.packets(); ++q) set_window(tile, q);
}

}  // namespace
}  // namespace mjsense::render
