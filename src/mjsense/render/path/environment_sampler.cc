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
double solid_angle(double s, double t) {
  const double square = 1 + s * s + t * t;
  return 1 / (square * std::sqrt(square));
}

constexpr int kParts = 16384;  // of the probability; there are 23,814 cells

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
  if (!(total > 0)) return;
  for (double& end : ends_) end /= total;
  int cell = 0;
  for (int part = 0; part <= kParts; ++part) {
    while (cell + 1 < std::ssize(ends_) && ends_[cell] <= static_cast<double>(part) / kParts)
      ++cell;
    starts_.push_back(cell);
  }
}

Rgb64 EnvironmentSampler::between(int face, int y, int x, double down, double across) const {
  const auto* texel = &texels_[(face * size_ + y) * size_ + x];
  Rgb64 out;
  for (int c = 0; c < 3; ++c) {
    const double top = texel[0][c] + across * (texel[1][c] - texel[0][c]);
    const double bottom = texel[size_][c] + across * (texel[size_ + 1][c] - texel[size_][c]);
    out[c] = top + down * (bottom - top);
  }
  return out;
}

Rgb64 EnvironmentSampler::radiance(const Vec3& direction) const {
  const CubePlace at = cube_place(direction);
  const CellPlace x(at.s, size_ - 1), y(at.t, size_ - 1);
  return between(at.face, y.cell, x.cell, y.within, x.within);
}

EnvironmentSampler::Sample EnvironmentSampler::sample(double choice, double u, double v) const {
  const int part = static_cast<int>(choice * kParts);
  const auto first = ends_.begin() + starts_[part], last = ends_.begin() + starts_[part + 1];
  const int cell = static_cast<int>(std::upper_bound(first, last, choice) - ends_.begin());
  const int cells = size_ - 1;
  const int face = cell / (cells * cells), x = cell % cells, y = cell / cells % cells;
  const double s = 2 * (x + u) / cells - 1, t = 2 * (y + v) / cells - 1;
  return {cube_direction({face, s, t}), density(cell, s, t), between(face, y, x, v, u)};
}

double EnvironmentSampler::density(int cell, double s, double t) const {
  const double share = ends_[cell] - (cell ? ends_[cell - 1] : 0);
  const int cells = size_ - 1;
  return share * cells * cells / 4 / solid_angle(s, t);
}

double EnvironmentSampler::density(const Vec3& direction) const {
  const CubePlace at = cube_place(direction);
  const int cells = size_ - 1;
  const CellPlace x(at.s, cells), y(at.t, cells);
  return density((at.face * cells + y.cell) * cells + x.cell, at.s, at.t);
}

}  // namespace mjsense::render
