// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/physical_light.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "mjsense/render/light/brdf_table.h"
#include "mjsense/render/light/tone_map.h"

namespace mjsense::render {
namespace {

// Radiance of the environment, whose mean is 1, in classic units.
constexpr double kEnvironmentLevel = 0.3;

using Curve = std::array<float, ToneCurve::kValues + 1>;

// `shown`: the value in [0, 1] that the display gets for each value of the table.
Curve make_curve(const std::function<double(double)>& shown) {
  Curve out;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto bits =
        (static_cast<std::uint32_t>(ToneCurve::kFirst) + static_cast<std::uint32_t>(i))
        << ToneCurve::kShift;
    const double x = static_cast<double>(std::bit_cast<float>(bits)) - ToneCurve::kOffset;
    out[i] = static_cast<float>(shown(x));
  }
  return out;
}

void set_curves(ToneMapping mapping, PhysicalView& out) {
  const auto encoded = [](double x) { return srgb_encode(std::clamp(x, 0.0, 1.0)); };
  static const Curve plain = make_curve(encoded);
  static const Curve s_shaped = make_curve([&](double x) { return encoded(filmic(x)); });
  static const Curve agx_curve = make_curve(agx_contrast);
  static const Curve agx_display = make_curve([&](double x) { return encoded(agx_linear(x)); });
  out.tone_mapping = mapping;
  out.tone_curve = (mapping == ToneMapping::kFilmic ? s_shaped
                    : mapping == ToneMapping::kAgx  ? agx_curve
                                                    : plain)
                       .data();
  out.display_curve = agx_display.data();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      out.agx_inset[3 * i + j] = static_cast<float>(kAgxInset[i][j]);
      out.agx_outset[3 * i + j] = static_cast<float>(kAgxOutset[i][j]);
    }
}

std::vector<std::uint32_t> pack_specular_table() {
  std::vector<std::uint32_t> out;
  const auto part = [](float x) {
    return static_cast<std::uint32_t>(std::lround(std::clamp(x, 0.0f, 1.0f) * 65535));
  };
  for (const auto& row : brdf_table().entries)
    for (int column = 0; column < SpecularTable::kStride; ++column) {
      const BrdfTable::Entry& entry = row[std::min(column, SpecularTable::kColumns - 1)];
      out.push_back(part(entry.a) | part(entry.b) << 16);
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

void set_irradiance(const EnvironmentLight& light, const Rgb64& scales, PhysicalView& out) {
  for (int c = 0; c < 3; ++c) {
    const auto k = [&](int i) { return scales[c] * light.irradiance[i][c]; };
    const double quadratic[3][3] = {
        {k(8), k(4) / 2, k(7) / 2}, {k(4) / 2, -k(8), k(5) / 2}, {k(7) / 2, k(5) / 2, 3 * k(6)}};
    const double linear[3] = {k(3), k(1), k(2)};
    double q[3][3];
    turn(quadratic, out.r_ec, q);
    const auto set = [&](int i, double x) { out.irradiance[i][c] = static_cast<float>(x); };
    set(0, k(0) - k(6));
    for (int i = 0; i < 3; ++i) {
      double along = 0;
      for (int a = 0; a < 3; ++a) along += linear[a] * out.r_ec[3 * a + i];
      set(1 + i, along);
      set(4 + i, q[i][i]);
    }
    set(7, 2 * q[0][1]);
    set(8, 2 * q[0][2]);
    set(9, 2 * q[1][2]);
  }
}

}  // namespace

double maximum_radiance(double exposure) { return 1 / exposure_scale(exposure); }

Rgb64 environment_factors(const float diffuse[3], float intensity) {
  if (!(intensity > 0)) return {1, 1, 1};
  Rgb64 out;
  for (int c = 0; c < 3; ++c)
    out[c] = diffuse[c] * intensity / (std::numbers::pi * kEnvironmentLevel * kClassicRadiance);
  return out;
}

void set_physical(const PhysicalOptions& options, const Rgb64& tint, const double rotation[9],
                  PhysicalView& out) {
  static const std::vector<std::uint32_t> specular_table = pack_specular_table();
  out.on = true;
  set_curves(options.tone_mapping, out);
  out.specular_table = specular_table.data();
  const double white = maximum_radiance(options.exposure);
  out.white_radiance = static_cast<float>(white);
  out.unit = static_cast<float>(kClassicRadiance / white);
  out.occlusion_reach = options.occlusion_reach;
  out.all_geoms = options.path_samples > 0;
  const Rgb64 gains = white_balance(options.white_balance);
  for (int c = 0; c < 3; ++c) out.white[c] = static_cast<float>(gains[c]);
  const double turn = options.environment_rotation * std::numbers::pi / 180;
  const double cosine = std::cos(turn), sine = std::sin(turn);
  for (int j = 0; j < 3; ++j) {
    const double x = rotation[j], y = rotation[3 + j];
    out.r_ec[j] = static_cast<float>(cosine * x + sine * y);
    out.r_ec[3 + j] = static_cast<float>(cosine * y - sine * x);
    out.r_ec[6 + j] = static_cast<float>(rotation[6 + j]);
  }
  const EnvironmentLight& light = options.environment->light;
  out.radiance = &light.radiance;
  const double scale = kEnvironmentLevel * options.environment_intensity * out.unit;
  Rgb64 scales{scale, scale, scale};
  for (int c = 0; c < 3; ++c) {
    if (options.follows_image_light) scales[c] *= tint[c];
    out.radiance_scale[c] = static_cast<float>(scales[c]);
  }
  set_irradiance(light, scales, out);
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
