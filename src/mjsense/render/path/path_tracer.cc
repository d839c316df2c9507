// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/path/path_tracer.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "mjsense/render/kernels/display_colors.h"
#include "mjsense/render/path/path_wave.h"

namespace mjsense::render {
namespace {

// Samples of a tile that are traced together. More of them have more similar rays in a packet.
constexpr int kTogether = 16;

}  // namespace

void PathTracer::build(const View& view) {
  scene_.build(view);
  lights_.build(view);
}

void PathTracer::render(int first, int last, const ImageTargets& targets) const {
  const View& view = scene_.view();
  const int width = view.grid.width, height = view.grid.height;
  PathWave wave(scene_, lights_);
  std::vector<double> sum;
  std::vector<float> colors;
  for (int y0 = first * kTileSize; y0 < std::min(last * kTileSize, height); y0 += kTileSize) {
    const int y1 = std::min(y0 + kTileSize, height);
    for (int x0 = 0; x0 < width; x0 += kTileSize) {
      const int x1 = std::min(x0 + kTileSize, width);
      sum.assign(3 * static_cast<std::size_t>((x1 - x0) * (y1 - y0)), 0);
      for (int s = 0; s < samples_; s += kTogether)
        wave.add_samples(x0, x1, y0, y1, s, std::min(s + kTogether, samples_), sum);
      colors.resize(sum.size());
      for (std::size_t i = 0; i < sum.size(); ++i)
        colors[i] = static_cast<float>(sum[i] / samples_);
      const auto write = [&](auto* image, auto value) {
        const float* from = colors.data();
        for (int y = y0; y < y1; ++y)
          for (int i = 3 * x0; i < 3 * x1; ++i)
            image[3 * static_cast<std::size_t>(y) * width + i] = value(*from++);
      };
      if (targets.hdr)
        write(targets.hdr, [&](float x) { return x * view.physical.white_radiance; });
      if (!targets.rgb) continue;
      map_to_display(view.physical, colors);
      write(targets.rgb, [](float x) {
        return static_cast<std::uint8_t>(std::lround(255 * std::clamp(x, 0.0f, 1.0f)));
      });
    }
  }
}

}  // namespace mjsense::render
