// SPDX-License-Identifier: Apache-2.0
#pragma once
// Share of a uniform environment that a microfacet lobe reflects, as a table (the "split-sum"
// approximation: B. Karis, Real Shading in Unreal Engine 4, SIGGRAPH 2013 course).

#include <array>

namespace mjsense::render {

// The lobe with GGX distribution and height-correlated Smith visibility, without further bounces,
// reflects f0 * a + f90 * b, for Schlick's Fresnel term from f0 to f90. a + b is its albedo where
// everything is reflected.
struct BrdfTable {
  struct Entry {
    float a, b;
  };
  static constexpr int kSize = 64;
  // [roughness, N . V], both linear from 0 to 1 inclusive
  std::array<std::array<Entry, kSize>, kSize> entries;

  // Bilinear interpolation. Its error is below 0.006 where N . V >= 0.05.
  Entry at(float roughness, float n_v) const;
};

// Computed by the first call, in 0.1 s.
const BrdfTable& brdf_table();

// The same by integration with `samples` fixed points.
BrdfTable::Entry integrate_brdf(double roughness, double n_v, int samples);

}  // namespace mjsense::render
