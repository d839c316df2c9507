// SPDX-License-Identifier: Apache-2.0
// Materials, the table of their lobes, and tone curves against formulas.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/render/light/brdf_table.h"
#include "mjsense/render/light/material.h"
#include "mjsense/render/light/microfacets.h"
#include "mjsense/render/light/tone_map.h"

namespace mjsense::render {
namespace {

constexpr double kPi = std::numbers::pi;

// What a material reflects of a uniform environment of radiance 1: the lobe by sampling its visible
// normals, and the matte part by cosine-weighted directions.
Rgb64 furnace(const Substance& substance, double n_v, int samples) {
  const Reflectance r(substance, n_v);
  const Reflectance lobe_only = [&] {
    Reflectance lobe = r;
    lobe.matte = {};
    return lobe;
  }();
  const Vec3 v{std::sqrt(1 - n_v * n_v), 0, n_v};
  Rgb64 sum = r.matte;
  for (int i = 0; i < samples; ++i) {
    const Vec3 h = visible_normal(v, r.alpha, (i + 0.5) / samples, radical_inverse(i));
    const double v_h = dot(v, h), n_l = 2 * v_h * h[2] - v[2];
    if (n_l <= 0) continue;
    const double density = masking(n_v, r.alpha) * ggx(h[2], r.alpha) / (4 * n_v);
    const Rgb64 f = lobe_only.brdf(n_l, h[2], v_h);
    for (int c = 0; c < 3; ++c) sum[c] += f[c] * n_l / density / samples;
  }
  return sum;
}

TEST(LightModel, WhiteMaterialsReflectAUniformEnvironmentWithoutLoss) {
  for (int r = 0; r <= 10; ++r)
    for (int m = 0; m <= 10; ++m)
      for (double n_v : {0.1, 0.3, 0.7, 1.0})
        for (double x : furnace({{1, 1, 1}, m / 10.0, r / 10.0, 0.04}, n_v, 4096))
          EXPECT_NEAR(x, 1, 0.01) << "roughness " << r / 10.0 << " metallic " << m / 10.0 << " N.V "
                                  << n_v;
}

TEST(LightModel, NoMaterialReflectsMoreThanItGets) {
  for (double base : {0.0, 0.2, 0.8})
    for (double roughness : {0.0, 0.3, 1.0})
      for (double metallic : {0.0, 0.5, 1.0})
        for (double n_v : {0.05, 0.5, 1.0})
          for (double x : furnace({{base, base, base}, metallic, roughness, 0.16}, n_v, 2048))
            EXPECT_LE(x, 1.01);
}

TEST(LightModel, WithoutSpecularAMaterialIsLambertian) {
  const Reflectance r({{0.5, 0.25, 1}, 0, 0.5, dielectric_f0(0)}, 0.3);
  const Rgb64 f = r.brdf(0.4, 0.6, 0.2);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(f[c], (Rgb64{0.5, 0.25, 1}[c]) / kPi, 1e-12);
}

TEST(LightModel, FieldsThatAreNotSetFollowFromClassicOnes) {
  EXPECT_DOUBLE_EQ(dielectric_f0(0.5), 0.04);
  EXPECT_DOUBLE_EQ(roughness_of(-1, 0.75), 0.25);
  EXPECT_DOUBLE_EQ(roughness_of(0.1, 0.75), 0.1);
  EXPECT_DOUBLE_EQ(metallic_of(-1), 0);
  EXPECT_DOUBLE_EQ(metallic_of(0.5), 0.5);
}

// The projected area of the microfacets is that of the surface: the integral of D (N . H).
TEST(LightModel, DistributionCoversTheSurface) {
  for (double alpha : {0.05, 0.3, 1.0}) {
    double sum = 0;
    constexpr int kSteps = 200000;
    for (int i = 0; i < kSteps; ++i) {
      const double u = (i + 0.5) / kSteps, angle = 0.5 * kPi * u * u;
      sum += ggx(std::cos(angle), alpha) * std::cos(angle) * std::sin(angle) * kPi * u / kSteps;
    }
    EXPECT_NEAR(2 * kPi * sum, 1, 1e-3) << alpha;
  }
}

TEST(LightModel, TableEqualsTheIntegral) {
  double worst = 0;
  for (double roughness : {0.02, 0.13, 0.31, 0.52, 0.77, 0.98})
    for (double n_v : {0.05, 0.11, 0.27, 0.5, 0.83, 0.99}) {
      const auto table = brdf_table().at(static_cast<float>(roughness), static_cast<float>(n_v));
      const auto exact = integrate_brdf(roughness, n_v, 1 << 16);
      worst = std::max<double>({worst, std::abs(table.a - exact.a), std::abs(table.b - exact.b)});
    }
  EXPECT_LT(worst, 0.006);
}

TEST(LightModel, CurvesRiseFromBlackToWhite) {
  Rgb64 last = {-1, -1, -1};
  for (int i = 0; i <= 4000; ++i) {
    const double x = i == 0 ? 0 : 1e-4 * std::pow(10, i / 800.0);
    const Rgb64 now = {filmic(x), neutral({x, x, x})[1], agx({x, x, x})[1]};
    for (int c = 0; c < 3; ++c) {
      EXPECT_GE(now[c], last[c] - 1e-9) << "curve " << c << " at " << x;
      EXPECT_GE(now[c], 0);
      EXPECT_LE(now[c], 1);
    }
    last = now;
  }
  EXPECT_NEAR(filmic(0), 0, 1e-12);
  EXPECT_NEAR(filmic(0.18), 0.18, 1e-6);
  EXPECT_NEAR(neutral({0.54, 0.34, 0.24})[0], 0.5, 1e-12);  // materials keep their differences
  // AgX shows middle grey as half of a display's range, at its gamma of 2.2.
  EXPECT_NEAR(std::pow(agx({0.18, 0.18, 0.18})[0], 1 / 2.2), 0.5, 0.01);
  for (double end : last) EXPECT_GT(end, 0.95);
}

TEST(LightModel, SrgbAndItsInverse) {
  for (int i = 0; i <= 255; ++i) EXPECT_NEAR(srgb_encode(srgb_decode(i / 255.0)), i / 255.0, 1e-9);
  EXPECT_NEAR(srgb_encode(0.2140411), 0.5, 1e-6);
}

TEST(LightModel, ExposureAndWhiteBalance) {
  EXPECT_DOUBLE_EQ(exposure_scale(0), 1 / 1.2);
  EXPECT_DOUBLE_EQ(exposure_scale(3), 1 / 9.6);
  for (double gain : white_balance(kDaylight)) EXPECT_EQ(gain, 1);
  const Rgb64 lamp = white_balance(2856), shade = white_balance(10000);
  EXPECT_LT(lamp[0], lamp[1]);
  EXPECT_LT(lamp[1], lamp[2]);
  EXPECT_GT(shade[0], shade[1]);
  EXPECT_GT(shade[1], shade[2]);
}

}  // namespace
}  // namespace mjsense::render
