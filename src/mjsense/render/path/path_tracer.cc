// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/path/path_tracer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "mjsense/render/light/tone_map.h"
#include "mjsense/render/path/path_wave.h"

namespace mjsense::render {
namespace {

// As ToneCurve.
double tone_curve(const float* table, double x) {
  const float y =
      static_cast<float>(std::clamp<double>(x, 0, ToneCurve::kEnd)) + ToneCurve::kOffset;
  const auto at = std::bit_cast<std::uint32_t>(y);
  const float* value = table + (at >> ToneCurve::kShift) - ToneCurve::kFirst;
  const double part =
      static_cast<double>(at & ((1u << ToneCurve::kShift) - 1)) / (1u << ToneCurve::kShift);
  return std::lerp<double>(value[0], value[1], part);
}

void put(const View&, const Rgb64& radiance, float* out) {
  for (int c = 0; c < 3; ++c) out[c] = static_cast<float>(radiance[c]);
}

void put(const View& view, const Rgb64& radiance, std::uint8_t* out) {
  const PhysicalView& p = view.physical;
  const Rgb64 shown =
      p.tone_mapping == ToneMapping::kNeutral ? render::neutral(radiance) : radiance;
  for (int c = 0; c < 3; ++c)
    out[c] = static_cast<std::uint8_t>(
        std::lround(255 * std::clamp(tone_curve(p.tone_curve, shown[c]), 0.0, 1.0)));
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
      for (int s = 0; s < samples_; ++s) wave.add_sample(x0, x1, y0, y1, s, sum);
      const double* from = sum.data();
      for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x, from += 3)
          put(view, {from[0] / samples_, from[1] / samples_, from[2] / samples_},
              image + 3 * (static_cast<std::size_t>(y) * width + x));
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
