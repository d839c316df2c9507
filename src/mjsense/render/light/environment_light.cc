// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/light/environment_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "mjsense/render/light/microfacets.h"

namespace mjsense::render {
namespace {

using RadianceByHeight = std::function<double(double)>;

constexpr std::array<int, 9> kSizes{64, 32, 32, 32, 16, 16, 16, 16, 16};
constexpr int kSteps = 128;  // of z in a table of one level

// z of texel (x, y) of a face; faces as in the kernels: +x -x +y -y +z -z.
double height_of(int face, double s, double t) {
  const double z[] = {-s, s, t, -t, 1, -1};
  return z[face] / std::sqrt(1 + s * s + t * t);
}

// RadianceByHeight by z that a GGX lobe of this roughness sees, with n = v = r.
std::array<double, kSteps + 1> seen_by_lobe(const RadianceByHeight& radiance, double roughness) {
  constexpr int kSamples = 512;
  const double a2 = std::pow(roughness, 4);
  std::array<double, kSteps + 1> out;
  for (int i = 0; i <= kSteps; ++i) {
    const double z = -1 + 2.0 * i / kSteps, level = std::sqrt(std::max(0.0, 1 - z * z));
    if (roughness == 0) {
      out[i] = radiance(z);
      continue;
    }
    double sum = 0, weights = 0;
    for (int k = 0; k < kSamples; ++k) {
      const double turn = radical_inverse(k), u = (k + 0.5) / kSamples,
                   cosine = std::sqrt((1 - u) / (1 + (a2 - 1) * u));
      const double nl = 2 * cosine * cosine - 1;
      if (nl <= 0) continue;
      const double sine = std::sqrt(1 - nl * nl);
      sum += nl * radiance(nl * z + sine * level * std::cos(2 * std::numbers::pi * turn));
      weights += nl;
    }
    out[i] = sum / weights;
  }
  return out;
}

}  // namespace

std::uint32_t pack_rgb9e5(const float rgb[3]) {
  const float largest = std::max({rgb[0], rgb[1], rgb[2]});
  if (!(largest > 0)) return 0;
  constexpr float kLargest = 65408;  // 511 / 512 * 2^16
  int exponent;
  std::frexp(std::min(largest, kLargest), &exponent);
  exponent = std::max(exponent, -15);
  if (std::lround(std::ldexp(std::min(largest, kLargest), 9 - exponent)) == 512) ++exponent;
  std::uint32_t out = static_cast<std::uint32_t>(exponent + 15) << 27;
  for (int c = 0; c < 3; ++c)
    out |= static_cast<std::uint32_t>(
               std::lround(std::ldexp(std::clamp(rgb[c], 0.0f, kLargest), 9 - exponent)))
           << 9 * c;
  return out;
}

std::array<float, 3> unpack_rgb9e5(std::uint32_t texel) {
  const int exponent = static_cast<int>(texel >> 27) - 15 - 9;
  std::array<float, 3> out;
  for (int c = 0; c < 3; ++c)
    out[c] = std::ldexp(static_cast<float>(texel >> 9 * c & 511), exponent);
  return out;
}

std::shared_ptr<const Environment> upright_environment(const RadianceByHeight& radiance) {
  auto out = std::make_shared<Environment>();
  // Legendre coefficients, times the cosine lobe's (R. Ramamoorthi and P. Hanrahan, 2001).
  double l0 = 0, l1 = 0, l2 = 0;
  constexpr int kPoints = 4096;
  for (int i = 0; i < kPoints; ++i) {
    const double z = -1 + (2 * i + 1.0) / kPoints, r = radiance(z) / kPoints;
    l0 += r;
    l1 += r * z;
    l2 += r * (3 * z * z - 1) / 2;
  }
  for (auto& rgb : out->light.irradiance) std::ranges::fill(rgb, 0.0f);
  std::ranges::fill(out->light.irradiance[0], static_cast<float>(l0));
  std::ranges::fill(out->light.irradiance[2], static_cast<float>(3 * l1 * 2 / 3));
  std::ranges::fill(out->light.irradiance[6], static_cast<float>(5 * l2 / 4 / 2));
  Texture& map = out->light.radiance;
  map.cube = true;
  map.levels = static_cast<int>(kSizes.size());
  for (int l = 0; l < map.levels; ++l) {
    const int n = kSizes[l];
    map.width[l] = map.height[l] = static_cast<float>(n);
    map.offset[l] = static_cast<int>(out->texels.size());
    const auto table = seen_by_lobe(radiance, static_cast<double>(l) / (map.levels - 1));
    const auto place = [&](int i) { return -1 + 2.0 * std::min(i, n - 1) / (n - 1); };
    for (int face = 0; face < 6; ++face)
      for (int y = 0; y < n; ++y)
        for (int x = 0; x <= n; ++x) {  // the last texel of a row is stored twice
          const double at = (height_of(face, place(x), place(y)) + 1) * kSteps / 2;
          const int i = std::min(static_cast<int>(at), kSteps - 1);
          const auto grey = static_cast<float>(std::lerp(table[i], table[i + 1], at - i));
          out->texels.push_back(pack_rgb9e5(std::array{grey, grey, grey}.data()));
        }
  }
  map.texels = out->texels.data();
  return out;
}

std::shared_ptr<const Environment> studio() {
  static const std::shared_ptr<const Environment> kStudio = upright_environment([](double z) {
    const auto ramp = [](double x) {
      x = std::clamp(x, 0.0, 1.0);
      return x * x * (3 - 2 * x);
    };
    const double floor_to_wall = std::lerp(0.5, 0.9, ramp((z + 0.4) / 0.5));
    return floor_to_wall + 0.35 * ramp((z - 0.1) / 0.6) + 1.6 * ramp((z - 0.75) / 0.2);
  });
  return kStudio;
}

}  // namespace mjsense::render
