// SPDX-License-Identifier: Apache-2.0
#pragma once
// Random directions in which a surface reflects, in proportion to what it reflects there. Directions are
// in a frame whose z axis is the surface's normal.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/render/light/material.h"
#include "mjsense/render/light/microfacets.h"

namespace mjsense::render {

class Scatter {
 public:
  // v: to the viewer, v[2] > 0.
  Scatter(const Substance& substance, const Vec3& v) : v_(v), reflectance_(substance, v[2]) {
    const auto sum = [](const Rgb64& c) { return c[0] + c[1] + c[2]; };
    const double lobe = sum(reflectance_.lobe), matte = sum(reflectance_.matte);
    gloss_ = matte == 0 ? 1 : lobe == 0 ? 0 : std::clamp(lobe / (lobe + matte), 0.25, 0.9);
  }

  // For uniform numbers in [0, 1). The direction may be below the surface: it reflects nothing.
  Vec3 sample(double choice, double u, double w) const {
    if (choice < gloss_) {
      const Vec3 h = visible_normal(v_, reflectance_.alpha, u, w);
      const double twice = 2 * dot(v_, h);
      return {twice * h[0] - v_[0], twice * h[1] - v_[1], twice * h[2] - v_[2]};
    }
    const double radius = std::sqrt(u), angle = 2 * std::numbers::pi * w;
    return {radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1 - u)};
  }

  // Density of sample(), 1/sr, and the BRDF, 1/sr, times the cosine of incidence.
  struct Value {
    double density = 0;
    Rgb64 reflected{};
  };
  Value value(const Vec3& l) const {
    if (!(l[2] > 0)) return {};
    const Vec3 h = unit({l[0] + v_[0], l[1] + v_[1], l[2] + v_[2]});
    Value out;
    out.density =
        (1 - gloss_) * l[2] / std::numbers::pi +
        gloss_ * masking(v_[2], reflectance_.alpha) * ggx(h[2], reflectance_.alpha) / (4 * v_[2]);
    out.reflected = reflectance_.brdf(l[2], h[2], dot(v_, h));
    for (double& c : out.reflected) c *= l[2];
    return out;
  }

 private:
  Vec3 v_;
  Reflectance reflectance_;
  double gloss_;  // share of the samples that the specular lobe gets
};

}  // namespace mjsense::render
