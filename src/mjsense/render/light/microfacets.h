// SPDX-License-Identifier: Apache-2.0
#pragma once
// The GGX microfacet distribution, its visibility and its sampling, in double precision. Directions
// are unit vectors in a frame whose z axis is the surface's normal N; V points to the viewer, L to the
// light, H = (V + L) / |V + L|. alpha: GGX's width.

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace mjsense::render {

using Vec3 = std::array<double, 3>;
inline double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline Vec3 unit(const Vec3& a) {
  const double scale = 1 / std::sqrt(dot(a, a));
  return {a[0] * scale, a[1] * scale, a[2] * scale};
}

// Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007.
inline double ggx(double n_h, double alpha) {
  const double t = n_h * n_h * (alpha * alpha - 1) + 1;
  return alpha * alpha / (std::numbers::pi * t * t);
}

// Share of the microfacets towards a direction that are visible from it: Smith's G1.
inline double masking(double cosine, double alpha) {
  const double root = std::sqrt(cosine * cosine * (1 - alpha * alpha) + alpha * alpha);
  return 2 * cosine / (cosine + root);
}

// Height-correlated Smith's G2: visible from both directions. Heitz, Understanding the
// Masking-Shadowing Function, JCGT 2014.
inline double masking_and_shadowing(double n_l, double n_v, double alpha) {
  const double a2 = alpha * alpha;
  return 2 * n_l * n_v /
         (n_l * std::sqrt(n_v * n_v * (1 - a2) + a2) + n_v * std::sqrt(n_l * n_l * (1 - a2) + a2));
}

// A microfacet normal with the density G1(V) max(0, V . H) D(H) / N . V, for u, w uniform in [0, 1).
// Heitz, Sampling the GGX Distribution of Visible Normals, JCGT 2018.
inline Vec3 visible_normal(const Vec3& v, double alpha, double u, double w) {
  const Vec3 stretched = unit({alpha * v[0], alpha * v[1], v[2]});
  const double square = stretched[0] * stretched[0] + stretched[1] * stretched[1];
  const Vec3 across =
      square > 0 ? Vec3{-stretched[1] / std::sqrt(square), stretched[0] / std::sqrt(square), 0}
                 : Vec3{1, 0, 0};
  const Vec3 up = cross(stretched, across);
  const double radius = std::sqrt(u), angle = 2 * std::numbers::pi * w;
  const double x = radius * std::cos(angle), s = 0.5 * (1 + stretched[2]);
  const double y = (1 - s) * std::sqrt(std::max(0.0, 1 - x * x)) + s * radius * std::sin(angle);
  const double z = std::sqrt(std::max(0.0, 1 - x * x - y * y));
  Vec3 h;
  for (int k = 0; k < 3; ++k) h[k] = x * across[k] + y * up[k] + z * stretched[k];
  return unit({alpha * h[0], alpha * h[1], std::max(1e-9, h[2])});
}

// Two unit vectors that complete the unit vector `n` to a right-handed frame. Duff et al., Building
// an Orthonormal Basis, Revisited, JCGT 2017.
inline std::array<Vec3, 2> tangents(const Vec3& n) {
  const double sign = n[2] < 0 ? -1 : 1, a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
  return {Vec3{1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]},
          Vec3{b, sign + n[1] * n[1] * a, -n[1]}};
}

// Van der Corput's sequence in base 2: with i / n, the Hammersley points.
inline double radical_inverse(std::uint32_t i) {
  i = i << 16 | i >> 16;
  i = (i & 0x00ff00ff) << 8 | (i & 0xff00ff00) >> 8;
  i = (i & 0x0f0f0f0f) << 4 | (i & 0xf0f0f0f0) >> 4;
  i = (i & 0x33333333) << 2 | (i & 0xcccccccc) >> 2;
  i = (i & 0x55555555) << 1 | (i & 0xaaaaaaaa) >> 1;
  return i * 0x1p-32;
}

}  // namespace mjsense::render
