// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/path/environment_sampler.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/render/light/cube_map.h"
#include "mjsense/render/light/tone_map.h"

namespace mjsense::render {
namespace {

// Solid angle of an area 1 on a face, at (s, t).
double solid_angle(double s, double t) { return std::pow(1 + s * s + t * t, -1.5); }

// The cell that holds a place -1..1, and the position in it, 0..1.
struct CellPlace {
  int cell;
  double within;

  CellPlace(double place, int cells) {
    const double at = std::clamp((place + 1) / 2 * cells, 0.0, static_cast<double>(cells));
    cell = std::min(static_cast<int>(at), cells - 1);
    within = at - cell;
  }
};

}  // namespace

EnvironmentSampler::EnvironmentSampler(const EnvironmentLight& light)
    : size_(static_cast<int>(light.radiance.width[0])) {
  const Texture& map = light.radiance;
  texels_.reserve(6 * static_cast<std::size_t>(size_) * size_);
  for (int row = 0; row < 6 * size_; ++row)
    for (int x = 0; x < size_; ++x)
      texels_.push_back(unpack_rgb9e5(map.texels[map.offset[0] + row * (size_ + 1) + x]));
  const int cells = size_ - 1;
  const auto lum = [&](int face, int y, int x) {
    const std::array<float, 3>& c = texels_[(face * size_ + y) * size_ + x];
    return luminance({c[0], c[1], c[2]});
  };
  double total = 0;
  ends_.reserve(6 * static_cast<std::size_t>(cells) * cells);
  for (int face = 0; face < 6; ++face)
    for (int y = 0; y < cells; ++y)
      for (int x = 0; x < cells; ++x) {
        const double s = (2 * x + 1.0) / cells - 1, t = (2 * y + 1.0) / cells - 1;
        total += (lum(face, y, x) + lum(face, y, x + 1) + lum(face, y + 1, x) +
                  lum(face, y + 1, x + 1)) /
                 (cells * cells) * solid_angle(s, t);
        ends_.push_back(total);
      }
  mean_ = total / (4 * std::numbers::pi);
  if (total > 0)
    for (double& end : ends_) end /= total;
}

Rgb64 EnvironmentSampler::radiance(const Vec3& direction) const {
  const CubePlace at = cube_place(direction);
  const CellPlace x(at.s, size_ - 1), y(at.t, size_ - 1);
  const auto* texel = &texels_[(at.face * size_ + y.cell) * size_ + x.cell];
  Rgb64 out;
  for (int c = 0; c < 3; ++c)
    out[c] = std::lerp(std::lerp<double>(texel[0][c], texel[1][c], x.within),
                       std::lerp<double>(texel[size_][c], texel[size_ + 1][c], x.within), y.within);
  return out;
}

Vec3 EnvironmentSampler::sample(double choice, double u, double v) const {
  const auto found = std::ranges::upper_bound(ends_, choice);
  const int cells = size_ - 1;
  const int cell = static_cast<int>(std::min<std::ptrdiff_t>(
      found - ends_.begin(), static_cast<std::ptrdiff_t>(ends_.size()) - 1));
  const int x = cell % cells, y = cell / cells % cells;
  return cube_direction({cell / (cells * cells), 2 * (x + u) / cells - 1, 2 * (y + v) / cells - 1});
}

double EnvironmentSampler::density(const Vec3& direction) const {
  const CubePlace at = cube_place(direction);
  const int cells = size_ - 1;
  const CellPlace x(at.s, cells), y(at.t, cells);
  const int cell = (at.face * cells + y.cell) * cells + x.cell;
  const double share = ends_[cell] - (cell ? ends_[cell - 1] : 0);
  return share * cells * cells / 4 / solid_angle(at.s, at.t);
}

}  // namespace mjsense::render
