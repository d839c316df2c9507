// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/soft_lights.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace mjsense::render {
namespace {

bool is_soft(const Appearance& appearance, std::size_t i) {
  const ViewLight& light = appearance.lights()[i];
  return light.casts_shadows && light.kind != LightKind::kDirectional &&
         appearance.light_radii()[i] > 0;
}

// Van der Corput's sequence in base 2, for k < 64.
double radical_inverse(int k) {
  double out = 0, digit = 0.5;
  for (; k > 0; k /= 2, digit /= 2) out += digit * (k % 2);
  return out;
}

}  // namespace

int light_samples(const Appearance& appearance, std::size_t index, int samples) {
  if (samples <= 1 || !is_soft(appearance, index)) return 1;
  int soft = 0;
  const int all = static_cast<int>(appearance.lights().size());
  for (int i = 0; i < all; ++i) soft += is_soft(appearance, i) ? 1 : 0;
  return std::clamp((kMaxLights - (all - soft)) / soft, 1, samples);
}

void sample_position(const double center[3], float radius, int k, int count, double out[3]) {
  // Directions on Fibonacci's spiral; the radii make the points uniform within the ball.
  const double z = 1 - (2.0 * k + 1) / count, turn = k * std::numbers::pi * (3 - std::sqrt(5.0));
  const double level = std::sqrt(std::max(0.0, 1 - z * z));
  const double away = radius * std::cbrt(std::min(1.0, radical_inverse(k) + 0.5 / count));
  const double direction[3] = {level * std::cos(turn), level * std::sin(turn), z};
  for (int i = 0; i < 3; ++i) out[i] = center[i] + away * direction[i];
}

}  // namespace mjsense::render
