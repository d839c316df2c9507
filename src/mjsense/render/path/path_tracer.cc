// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/path/path_tracer.h"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <vector>

#include "mjsense/render/path/path_wave.h"

namespace mjsense::render {
namespace {

// Samples of a tile that are traced together. More of them have more similar rays in a packet.
constexpr int kTogether = 4;

void put(const PathPixel& pixel, float* out) { std::copy_n(pixel.rgb, 3, out); }

void put(const PathPixel& pixel, std::uint8_t* out) {
  for (int c = 0; c < 3; ++c)
    out[c] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(pixel.rgb[c], 0.0f, 1.0f)));
}

}  // namespace

void PathTracer::build(const View& view) {
  scene_.build(view);
  lights_.build(view);
}

template <class Value>
void PathTracer::render_rows(int first, int last, Value* image) const {
  const View& view = scene_.view();
  const int width = view.grid.width, height = view.grid.height;
  PathWave wave(scene_, lights_);
  std::vector<double> sum;
  for (int y0 = first * kTileSize; y0 < std::min(last * kTileSize, height); y0 += kTileSize) {
    const int y1 = std::min(y0 + kTileSize, height);
    for (int x0 = 0; x0 < width; x0 += kTileSize) {
      const int x1 = std::min(x0 + kTileSize, width);
      sum.assign(3 * static_cast<std::size_t>((x1 - x0) * (y1 - y0)), 0);
      for (int s = 0; s < samples_; s += kTogether)
        wave.add_samples(x0, x1, y0, y1, s, std::min(s + kTogether, samples_), sum);
      std::vector<PathPixel> pixels(sum.size() / 3);
      for (std::size_t i = 0; i < sum.size(); ++i)
        pixels[i / 3].rgb[i % 3] = static_cast<float>(sum[i] / samples_);
      if (std::is_same_v<Value, std::uint8_t>) map_to_display(view, pixels);
      const PathPixel* from = pixels.data();
      for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x, ++from)
          put(*from, image + 3 * (static_cast<std::size_t>(y) * width + x));
    }
  }
}

void PathTracer::render(int first, int last, std::uint8_t* rgb) const {
  render_rows(first, last, rgb);
}
void PathTracer::render(int first, int last, float* radiance) const {
  render_rows(first, last, radiance);
}

}  // namespace mjsense::render
