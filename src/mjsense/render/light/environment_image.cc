// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/light/environment_image.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "mjsense/render/light/cube_map.h"
#include "mjsense/render/light/tone_map.h"

namespace mjsense::render {
namespace {

template <class Radiance>
EnvironmentImage image_of(int height, Radiance radiance) {
  EnvironmentImage image{2 * height, height, {}};
  image.rgb.reserve(6 * static_cast<std::size_t>(height) * height);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const Rgb64 color = radiance(image.direction(x + 0.5, y + 0.5));
      for (double c : color) image.rgb.push_back(static_cast<float>(c));
    }
  return image;
}

}  // namespace

Vec3 EnvironmentImage::direction(double x, double y) const {
  const double azimuth = (1 - 2 * x / width) * std::numbers::pi,
               polar = std::numbers::pi * y / height;
  return {std::cos(azimuth) * std::sin(polar), std::sin(azimuth) * std::sin(polar),
          std::cos(polar)};
}

EnvironmentImage::Angles EnvironmentImage::angles_of(const Vec3& d) {
  const float pi = std::numbers::pi_v<float>;
  return {std::atan2(static_cast<float>(d[1]), static_cast<float>(d[0])) / pi,
          std::acos(std::clamp(static_cast<float>(d[2]), -1.0f, 1.0f)) / pi};
}

std::array<float, 3> EnvironmentImage::at(Angles angles) const {
  const float x = 0.5f * (1 - angles.azimuth) * static_cast<float>(width) - 0.5f;
  const float y = std::clamp(angles.polar * static_cast<float>(height) - 0.5f, 0.0f,
                             static_cast<float>(height - 1));
  const float left = std::floor(x);
  const int row = static_cast<int>(y), below = std::min(row + 1, height - 1);
  const int column = (static_cast<int>(left) + width) % width, right = (column + 1) % width;
  const float across = x - left, down = y - static_cast<float>(row);
  const auto texel = [&](int r, int c) {
    return rgb.data() + 3 * (static_cast<std::size_t>(r) * width + c);
  };
  const float *a = texel(row, column), *b = texel(row, right), *c = texel(below, column),
              *e = texel(below, right);
  std::array<float, 3> out;
  for (int k = 0; k < 3; ++k) {
    const float top = a[k] + across * (b[k] - a[k]), bottom = c[k] + across * (e[k] - c[k]);
    out[k] = top + down * (bottom - top);
  }
  return out;
}

double EnvironmentImage::solid_angle(int row) const {
  return 2 * std::numbers::pi / width *
         (std::cos(std::numbers::pi * row / height) -
          std::cos(std::numbers::pi * (row + 1) / height));
}

EnvironmentImage EnvironmentImage::halved() const {
  EnvironmentImage out{std::max(1, width / 2), std::max(1, height / 2), {}};
  out.rgb.reserve(3 * static_cast<std::size_t>(out.width) * out.height);
  const auto first = [](int i, int coarse, int fine) {
    return static_cast<int>(static_cast<std::int64_t>(i) * fine / coarse);
  };
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      double sum[3] = {}, total = 0;
      for (int r = first(y, out.height, height); r < first(y + 1, out.height, height); ++r)
        for (int c = first(x, out.width, width); c < first(x + 1, out.width, width); ++c) {
          const double weight = solid_angle(r);
          total += weight;
          for (int k = 0; k < 3; ++k)
            sum[k] += weight * rgb[3 * (static_cast<std::size_t>(r) * width + c) + k];
        }
      for (double s : sum) out.rgb.push_back(static_cast<float>(s / total));
    }
  return out;
}

EnvironmentImage skybox_image(const mjModel* m, int id) {
  const int size = m->tex_width[id], channels = m->tex_nchannel[id];
  const bool same = m->tex_height[id] == size;  // one image for all faces
  const mjtByte* data = m->tex_data + m->tex_adr[id];
  std::array<double, 256> linear;
  for (int i = 0; i < 256; ++i) linear[i] = srgb_decode(i / 255.0);
  return image_of(std::clamp(2 * size, 32, 512), [&](const Vec3& d) {
    // MuJoCo rotates the skybox by 90 degrees about x.
    const CubePlace at = cube_place({d[0], d[2], -d[1]});
    const auto place = [&](double s) {
      const double x = std::clamp((0.5 * s + 0.5) * size - 0.5, 0.0, size - 1.0);
      const int low = static_cast<int>(x);
      return std::tuple{low, std::min(low + 1, size - 1), x - low};
    };
    const auto [left, right, across] = place(at.s);
    const auto [top, bottom, down] = place(at.t);
    const auto texel = [&](int x, int y, int c) {
      const std::size_t row = static_cast<std::size_t>(same ? 0 : at.face) * size + y;
      return linear[data[(row * size + x) * channels + c]];
    };
    Rgb64 out;
    for (int c = 0; c < 3; ++c) {
      const double upper = std::lerp(texel(left, top, c), texel(right, top, c), across);
      const double lower = std::lerp(texel(left, bottom, c), texel(right, bottom, c), across);
      out[c] = std::lerp(upper, lower, down);
    }
    return out;
  });
}

}  // namespace mjsense::render
