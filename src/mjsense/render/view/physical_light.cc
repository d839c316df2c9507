// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/physical_light.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <vector>

namespace mjsense::render {
namespace {

// Radiance of the environment, whose mean is 1, in classic units.
constexpr double kEnvironmentLevel = 0.3;

double srgb_of_linear(double x) {
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

// K. Narkowicz, ACES Filmic Tone Mapping Curve, 2016, with the exposure of the original curve.
double filmic(double x) {
  x *= 0.6;
  return std::min(1.0, x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14));
}

using Curve = std::array<float, ToneCurve::kValues + 1>;

Curve make_curve(bool is_filmic) {
  Curve out;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto bits =
        (static_cast<std::uint32_t>(ToneCurve::kFirst) + static_cast<std::uint32_t>(i))
        << ToneCurve::kShift;
    const double x = static_cast<double>(std::bit_cast<float>(bits)) - ToneCurve::kOffset;
    out[i] = static_cast<float>(
        std::clamp(srgb_of_linear(is_filmic ? filmic(x) : std::clamp(x, 0.0, 1.0)), 0.0, 1.0));
  }
  return out;
}

const float* tone_curve_of(ToneMapping mapping) {
  static const Curve filmic_curve = make_curve(true), plain = make_curve(false);
  return (mapping == ToneMapping::kFilmic ? filmic_curve : plain).data();
}

std::vector<std::uint32_t> make_specular_table() {
  constexpr int kSamples = 512;
  std::vector<std::uint32_t> out;
  for (int row = 0; row < SpecularTable::kRows; ++row) {
    const double roughness = static_cast<double>(row) / (SpecularTable::kRows - 1);
    const double alpha = std::max(roughness * roughness, 1e-4), a2 = alpha * alpha;
    for (int column = 0; column < SpecularTable::kStride; ++column) {
      const double nv =
          std::clamp(static_cast<double>(column) / (SpecularTable::kColumns - 1), 1e-4, 1.0);
      const double vx = std::sqrt(1 - nv * nv);
      double a = 0, b = 0;
      for (int i = 0; i < kSamples; ++i) {
        double radical = 0, digit = 0.5;
        for (int k = i; k; k /= 2, digit /= 2) radical += digit * (k % 2);
        const double u = (i + 0.5) / kSamples, phi = 2 * std::numbers::pi * radical;
        const double c = std::sqrt((1 - u) / (1 + (a2 - 1) * u)), s = std::sqrt(1 - c * c);
        const double vh = vx * s * std::cos(phi) + nv * c;
        const double nl = 2 * vh * c - nv;
        if (nl <= 0) continue;
        const double smith =
            nl * std::sqrt(nv * nv * (1 - a2) + a2) + nv * std::sqrt(nl * nl * (1 - a2) + a2);
        const double weight = 2 * nl * vh / (smith * c) / kSamples;  // V * 4 nl vh / c
        const double fresnel = std::pow(1 - vh, 5);
        a += weight * (1 - fresnel);
        b += weight * fresnel;
      }
      const auto part = [](double x) {
        return static_cast<std::uint32_t>(std::lround(std::clamp(x, 0.0, 1.0) * 65535));
      };
      out.push_back(part(a) | part(b) << 16);
    }
  }
  return out;
}

// R^T M R.
void turn(const double m[3][3], const float r[9], double out[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      out[i][j] = 0;
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
          out[i][j] += static_cast<double>(r[3 * a + i]) * m[a][b] * r[3 * b + j];
    }
}

void set_irradiance(const EnvironmentLight& light, double scale, PhysicalView& out) {
  for (int c = 0; c < 3; ++c) {
    const auto k = [&](int i) { return scale * light.irradiance[i][c]; };
    const double quadratic[3][3] = {
        {k(8), k(4) / 2, k(7) / 2}, {k(4) / 2, -k(8), k(5) / 2}, {k(7) / 2, k(5) / 2, 3 * k(6)}};
    const double linear[3] = {k(3), k(1), k(2)};
    double q[3][3];
    turn(quadratic, out.r_wc, q);
    const auto set = [&](int i, double x) { out.irradiance[i][c] = static_cast<float>(x); };
    set(0, k(0) - k(6));
    for (int i = 0; i < 3; ++i) {
      double along = 0;
      for (int a = 0; a < 3; ++a) along += linear[a] * out.r_wc[3 * a + i];
      set(1 + i, along);
      set(4 + i, q[i][i]);
    }
    set(7, 2 * q[0][1]);
    set(8, 2 * q[0][2]);
    set(9, 2 * q[1][2]);
  }
}

}  // namespace

double maximum_radiance(double exposure) { return 1.2 * std::exp2(exposure); }

float linear_of_srgb(float x) {
  return x <= 0.04045f
             ? x / 12.92f
             : static_cast<float>(std::pow((static_cast<double>(x) + 0.055) / 1.055, 2.4));
}

void set_physical(const PhysicalOptions& options, const double rotation[9], PhysicalView& out) {
  static const std::vector<std::uint32_t> specular_table = make_specular_table();
  out.on = true;
  out.tone_mapping = options.tone_mapping;
  out.tone_curve = tone_curve_of(options.tone_mapping);
  out.specular_table = specular_table.data();
  out.unit = static_cast<float>(kClassicRadiance / maximum_radiance(options.exposure));
  out.occlusion_reach = options.occlusion_reach;
  for (int i = 0; i < 9; ++i) out.r_wc[i] = static_cast<float>(rotation[i]);
  const EnvironmentLight& light = options.environment->light;
  out.radiance = &light.radiance;
  const double scale = kEnvironmentLevel * options.environment_intensity * out.unit;
  out.radiance_scale = static_cast<float>(scale);
  set_irradiance(light, scale, out);
}

void set_physical(const PhysicalOptions& options, float intensity, float range, ViewLight& light) {
  const double maximum = maximum_radiance(options.exposure);
  double scale = kClassicLight * kClassicRadiance / maximum;
  if (intensity > 0) {
    scale = intensity / (std::numbers::pi * maximum);
    if (light.kind != LightKind::kDirectional) {
      light.attenuation[0] = light.attenuation[1] = 0;
      light.attenuation[2] = 1;
      light.range = range;
    }
  }
  for (float& x : light.diffuse) x = static_cast<float>(x * scale);
}

}  // namespace mjsense::render
