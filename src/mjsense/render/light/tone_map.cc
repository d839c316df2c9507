// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/light/tone_map.h"

#include <algorithm>
#include <cmath>

namespace mjsense::render {
namespace {

Rgb64 times(const Matrix& m, const Rgb64& v) {
  Rgb64 out;
  for (int i = 0; i < 3; ++i) out[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
  return out;
}

constexpr Matrix kBradford = {
    {{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}}};
constexpr Matrix kBradfordInverse = {{{0.9869929, -0.1470543, 0.1599627},
                                      {0.4323053, 0.5183603, 0.0492912},
                                      {-0.0085287, 0.0400428, 0.9684867}}};
constexpr Matrix kXyzToSrgb = {{{3.2404542, -1.5371385, -0.4985314},
                                {-0.9692660, 1.8760108, 0.0415560},
                                {0.0556434, -0.2040259, 1.0572252}}};
constexpr Matrix kSrgbToXyz = {{{0.4124564, 0.3575761, 0.1804375},
                                {0.2126729, 0.7151522, 0.0721750},
                                {0.0193339, 0.1191920, 0.9503041}}};

// Chromaticity of daylight (CIE D, 4000 K and above) or of a black body (Kang et al., Design of
// Advanced Color Temperature Control System, 2002), mixed between 4000 and 5000 K.
std::array<double, 2> chromaticity(double kelvin) {
  const double t = 1e3 / kelvin;
  const auto cubic = [](double x, double a, double b, double c, double d) {
    return ((a * x + b) * x + c) * x + d;
  };
  const double dx = kelvin <= 7000 ? cubic(t, -4.6070, 2.9678, 0.09911, 0.244063)
                                   : cubic(t, -2.0064, 1.9018, 0.24748, 0.237040);
  const double dy = cubic(dx, 0, -3.000, 2.870, -0.275);
  const double bx = kelvin <= 4000 ? cubic(t, -0.2661239, -0.2343589, 0.8776956, 0.179910)
                                   : cubic(t, -3.0258469, 2.1070379, 0.2226347, 0.240390);
  const double by = kelvin <= 2222   ? cubic(bx, -1.1063814, -1.34811020, 2.18555832, -0.20219683)
                    : kelvin <= 4000 ? cubic(bx, -0.9549476, -1.37418593, 2.09137015, -0.16748867)
                                     : cubic(bx, 3.0817580, -5.87338670, 3.75112997, -0.37001483);
  const double day = std::clamp((kelvin - 4000) / 1000, 0.0, 1.0);
  return {bx + day * (dx - bx), by + day * (dy - by)};
}

Rgb64 cones(double kelvin) {
  const auto [x, y] = chromaticity(kelvin);
  return times(kBradford, {x / y, 1, (1 - x - y) / y});
}

}  // namespace

double srgb_encode(double x) {
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

double srgb_decode(double y) {
  return y <= 0.04045 ? y / 12.92 : std::pow((y + 0.055) / 1.055, 2.4);
}

double exposure_scale(double ev) { return 1 / (1.2 * std::exp2(ev)); }

Rgb64 white_balance(double kelvin) {
  // The colour that white gets in this light, in linear sRGB with the same luminance.
  const auto seen = [](double k) {
    const Rgb64 light = cones(k), day = cones(kDaylight);
    Rgb64 white = times(kBradford, times(kSrgbToXyz, {1, 1, 1}));
    for (int i = 0; i < 3; ++i) white[i] *= light[i] / day[i];
    return times(kXyzToSrgb, times(kBradfordInverse, white));
  };
  const Rgb64 color = seen(kelvin), day = seen(kDaylight);
  Rgb64 gains;
  for (int i = 0; i < 3; ++i) gains[i] = 1 / std::max(color[i] / day[i], 0.02);
  const double scale = luminance({1, 1, 1}) / luminance(gains);
  for (double& gain : gains) gain *= scale;
  return gains;
}

double filmic(double x) {
  // filmic(0.18) = 0.18
  constexpr double kScale = 0.7231708051;
  const double s = kScale * std::max(x, 0.0);
  return std::min(1.0, s * (2.51 * s + 0.03) / (s * (2.43 * s + 0.59) + 0.14));
}

Rgb64 neutral(const Rgb64& rgb) {
  constexpr double kStart = 0.8 - 0.04, kDesaturation = 0.15;
  const double low = std::max(0.0, std::min({rgb[0], rgb[1], rgb[2]}));
  const double offset = low < 0.08 ? low - 6.25 * low * low : 0.04;
  Rgb64 out;
  for (int c = 0; c < 3; ++c) out[c] = std::max(0.0, rgb[c] - offset);
  const double peak = std::max({out[0], out[1], out[2]});
  if (peak < kStart) return out;
  const double rest = 1 - kStart, compressed = 1 - rest * rest / (peak + rest - kStart);
  const double white = 1 - 1 / (kDesaturation * (peak - compressed) + 1);
  for (double& x : out) x = x * compressed / peak * (1 - white) + compressed * white;
  return out;
}

const Matrix kAgxInset{{{0.842479062253094, 0.0784335999999992, 0.0792237451477643},
                        {0.0423282422610123, 0.878468636469772, 0.0791661274605434},
                        {0.0423756549057051, 0.0784336, 0.879142973793104}}};
const Matrix kAgxOutset{{{1.19687900512017, -0.0980208811401368, -0.0990297440797205},
                         {-0.0528968517574562, 1.15190312990417, -0.0989611768448433},
                         {-0.0529716355144438, -0.0980434501171241, 1.15107367264116}}};

double agx_contrast(double x) {
  constexpr double kLow = -12.47393, kHigh = 4.026069;  // stops around 1
  const double v = (std::clamp(std::log2(std::max(x, 1e-10)), kLow, kHigh) - kLow) / (kHigh - kLow);
  return (((((15.5 * v - 40.14) * v + 31.96) * v - 6.868) * v + 0.4298) * v + 0.1191) * v - 0.00232;
}

double agx_linear(double x) { return std::pow(std::clamp(x, 0.0, 1.0), 2.2); }

Rgb64 agx(const Rgb64& rgb) {
  Rgb64 mixed = times(kAgxInset, rgb);
  for (double& x : mixed) x = agx_contrast(x);
  Rgb64 out = times(kAgxOutset, mixed);
  for (double& x : out) x = agx_linear(x);
  return out;
}

}  // namespace mjsense::render
