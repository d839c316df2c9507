// SPDX-License-Identifier: Apache-2.0
#pragma once
// The conversion in integer arithmetic, in loops that compilers vectorise. Everything is in an
// unnamed namespace and calls nothing of std::, because each instruction set must compile to a
// separate copy.

#include <cstddef>
#include <cstdint>

#include "mjsense/record/yuv.h"

namespace mjsense::record {
namespace {

constexpr int kTaps = 8;
constexpr int kRing = kTaps;  // chroma rows that are kept

struct Taps {
  int rows[kTaps];
  std::int16_t factors[kTaps];
};

// Source rows of chroma row `i` and their weights, in 4096ths: the bicubic kernel (0, 0.6) at half
// the resolution. Weights of rows outside the image go to its first or last row. Each rounding
// error is carried to the next tap, so that the sum is exact.
inline Taps taps_of(int i, int height) {
  constexpr int kTenths[kTaps] = {-576, -1728, 4928, 17856, 17856, 4928, -1728, -576};
  Taps taps = {};
  int error = 0, used = 0, sum = 0;
  for (int k = 0; k < kTaps; ++k) {
    const int wanted = 2 * i - kTaps / 2 + 1 + k;
    const int row = wanted < 0 ? 0 : wanted < height ? wanted : height - 1;
    sum += kTenths[k];
    const int next = wanted + 1 < 0 ? 0 : wanted + 1 < height ? wanted + 1 : height - 1;
    if (k + 1 < kTaps && next == row) continue;
    const int value = sum + error;
    const int factor = (value >= 0 ? value + 5 : value - 5) / 10;
    error = value - 10 * factor;
    taps.rows[used] = row;
    taps.factors[used++] = static_cast<std::int16_t>(factor);
    sum = 0;
  }
  for (; used < kTaps; ++used) taps.rows[used] = taps.rows[0];  // weight 0
  return taps;
}

inline void split(const std::uint8_t* __restrict rgb, int n, std::int16_t* __restrict r,
                  std::int16_t* __restrict g, std::int16_t* __restrict b) {
  for (int x = 0; x < n; ++x) {
    r[x] = rgb[3 * x];
    g[x] = rgb[3 * x + 1];
    b[x] = rgb[3 * x + 2];
  }
}

// 16 + (0.299 R + 0.587 G + 0.114 B) 219 / 255, rounded to 64ths, then to integers.
inline void luma(const std::int16_t* __restrict r, const std::int16_t* __restrict g,
                 const std::int16_t* __restrict b, int n, std::uint8_t* __restrict out) {
  for (int x = 0; x < n; ++x) {
    const int y = (8414 * r[x] + 16519 * g[x] + 3208 * b[x] + (32 << 14) + (1 << 8)) >> 9;
    out[x] = static_cast<std::uint8_t>((y + 32) >> 6);
  }
}

// 128 + (B - Y) 0.564 224 / 255 and 128 + (R - Y) 0.713 224 / 255 of the mean of two neighbouring
// pixels, in 128ths.
inline void chroma(const std::int16_t* __restrict r, const std::int16_t* __restrict g,
                   const std::int16_t* __restrict b, int n, std::int16_t* __restrict u,
                   std::int16_t* __restrict v) {
  for (int x = 0; x < n; ++x) {
    const int red = r[2 * x] + r[2 * x + 1];
    const int green = g[2 * x] + g[2 * x + 1];
    const int blue = b[2 * x] + b[2 * x + 1];
    constexpr int kOffset = (256 << 15) + (1 << 9);
    u[x] = static_cast<std::int16_t>(2 *
                                     ((-4856 * red - 9535 * green + 14392 * blue + kOffset) >> 10));
    v[x] = static_cast<std::int16_t>(2 *
                                     ((14392 * red - 12051 * green - 2340 * blue + kOffset) >> 10));
  }
}

// Each of the eight products is truncated to 8ths. The initial 7 eighths compensate for the
// truncations and for rounding.
inline void mix(const std::int16_t* const* rows, const std::int16_t* factors, int n,
                std::uint8_t* __restrict out) {
  for (int x = 0; x < n; ++x) {
    int sum = kTaps - 1;
    for (int k = 0; k < kTaps; ++k) sum += (factors[k] * rows[k][x]) >> 16;
    sum >>= 3;
    out[x] = static_cast<std::uint8_t>(sum < 0 ? 0 : sum > 255 ? 255 : sum);
  }
}

inline void convert(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                    std::int16_t* scratch) {
  const int columns = width + width % 2, rows = height + height % 2, half = columns / 2;
  std::int16_t *r = scratch, *g = r + columns, *b = g + columns, *ring = b + columns;
  std::uint8_t* u_out = out + static_cast<std::size_t>(columns) * rows;
  std::uint8_t* v_out = u_out + static_cast<std::size_t>(half) * (rows / 2);
  const auto u_row = [&](int y) { return ring + static_cast<std::size_t>(y % kRing) * columns; };
  constexpr int kAhead = kTaps / 2;
  for (int y = 0; y < rows + kAhead; ++y) {
    if (y < rows) {
      const int from = y < height ? y : height - 1;
      split(rgb + static_cast<std::size_t>(from) * width * 3, width, r, g, b);
      if (width < columns) {
        r[width] = r[width - 1];
        g[width] = g[width - 1];
        b[width] = b[width - 1];
      }
      luma(r, g, b, columns, out + static_cast<std::size_t>(y) * columns);
      chroma(r, g, b, half, u_row(y), u_row(y) + half);
    }
    if (y < kAhead || y % 2) continue;
    const int i = (y - kAhead) / 2;
    const Taps taps = taps_of(i, rows);
    const std::int16_t *u[kTaps], *v[kTaps];
    for (int k = 0; k < kTaps; ++k) {
      u[k] = u_row(taps.rows[k]);
      v[k] = u[k] + half;
    }
    mix(u, taps.factors, half, u_out + static_cast<std::size_t>(i) * half);
    mix(v, taps.factors, half, v_out + static_cast<std::size_t>(i) * half);
  }
}

}  // namespace
}  // namespace mjsense::record
