// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/light/brdf_table.h"

#include <algorithm>
#include <cmath>

#include "mjsense/render/light/material.h"
#include "mjsense/render/light/microfacets.h"

namespace mjsense::render {

BrdfTable::Entry integrate_brdf(double roughness, double n_v, int samples) {
  const double alpha = alpha_of(roughness), cosine = std::max(n_v, 1e-4);
  const Vec3 v{std::sqrt(std::max(0.0, 1 - cosine * cosine)), 0, cosine};
  double a = 0, b = 0;
  for (int i = 0; i < samples; ++i) {
    const Vec3 h = visible_normal(v, alpha, (i + 0.5) / samples, radical_inverse(i));
    const double v_h = dot(v, h), n_l = 2 * v_h * h[2] - v[2];
    if (n_l <= 0) continue;
    const double weight = masking_and_shadowing(n_l, cosine, alpha) / masking(cosine, alpha);
    const double fresnel = std::pow(1 - std::min(1.0, v_h), 5);
    a += (1 - fresnel) * weight;
    b += fresnel * weight;
  }
  return {static_cast<float>(a / samples), static_cast<float>(b / samples)};
}

BrdfTable::Entry BrdfTable::at(float roughness, float n_v) const {
  const auto place = [](float x) { return std::clamp(x, 0.0f, 1.0f) * (kSize - 1); };
  const float y = place(roughness), x = place(n_v);
  const int row = std::min(static_cast<int>(y), kSize - 2);
  const int column = std::min(static_cast<int>(x), kSize - 2);
  const float down = y - static_cast<float>(row), across = x - static_cast<float>(column);
  const auto mix = [&](float Entry::*part) {
    const auto along = [&](int r) {
      const float left = entries[r][column].*part, right = entries[r][column + 1].*part;
      return left + across * (right - left);
    };
    const float top = along(row), bottom = along(row + 1);
    return top + down * (bottom - top);
  };
  return {mix(&Entry::a), mix(&Entry::b)};
}

const BrdfTable& brdf_table() {
  static const BrdfTable table = [] {
    BrdfTable made;
    for (int r = 0; r < BrdfTable::kSize; ++r)
      for (int c = 0; c < BrdfTable::kSize; ++c)
        made.entries[r][c] =
            integrate_brdf(r / (BrdfTable::kSize - 1.0), c / (BrdfTable::kSize - 1.0), 512);
    return made;
  }();
  return table;
}

}  // namespace mjsense::render
