// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/light/material.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/render/light/brdf_table.h"
#include "mjsense/render/light/microfacets.h"

namespace mjsense::render {
namespace {

// Nothing that reflects less than 2 % at normal incidence reflects everything at grazing incidence
// (Filament 4.8.3.3).
double grazing(double f0) { return std::min(1.0, 50 * 0.33 * f0); }

}  // namespace

double alpha_of(double roughness) {
  const double r = std::max(roughness, kMinRoughness);
  return r * r;
}

double dielectric_f0(double specular) {
  return std::min(1.0, 0.16 * specular * specular);  // Filament 4.8.3.2
}

double roughness_of(double roughness, double shininess) {
  return std::clamp(roughness >= 0 ? roughness : 1 - shininess, 0.0, 1.0);
}

double metallic_of(double metallic) { return std::clamp(metallic, 0.0, 1.0); }

Reflectance::Reflectance(const Substance& s, double cosine)
    : alpha(alpha_of(s.roughness)), n_v(std::clamp(cosine, 1e-4, 1.0)) {
  const auto [a, b] = brdf_table().at(static_cast<float>(s.roughness), static_cast<float>(n_v));
  const double loss = 1 / std::max<double>(a + b, 1e-3) - 1;
  const double plain = 1 + s.f0 * loss, plain0 = plain * s.f0, plain90 = plain * grazing(s.f0);
  const double under = std::max(0.0, 1 - (plain0 * a + plain90 * b));
  const double metal90 = grazing((s.base[0] + s.base[1] + s.base[2]) / 3);
  for (int c = 0; c < 3; ++c) {
    const double metal = 1 + s.base[c] * loss;
    matte[c] = (1 - s.metallic) * under * s.base[c];
    f0[c] = (1 - s.metallic) * plain0 + s.metallic * metal * s.base[c];
    f90[c] = (1 - s.metallic) * plain90 + s.metallic * metal * metal90;
    lobe[c] = f0[c] * a + f90[c] * b;
  }
}

Rgb64 Reflectance::brdf(double n_l, double n_h, double v_h) const {
  const double shape = ggx(n_h, alpha) * masking_and_shadowing(n_l, n_v, alpha) / (4 * n_l * n_v);
  const double fresnel = std::pow(1 - std::clamp(v_h, 0.0, 1.0), 5);
  Rgb64 out;
  for (int c = 0; c < 3; ++c)
    out[c] = matte[c] / std::numbers::pi + shape * (f0[c] + (f90[c] - f0[c]) * fresnel);
  return out;
}

}  // namespace mjsense::render
