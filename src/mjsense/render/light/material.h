// SPDX-License-Identifier: Apache-2.0
#pragma once
// The metallic-roughness material of physically based images, in double precision: the reference for
// the kernels, and the material of path-traced images. A material is a mixture by `metallic` of a
// dielectric and a metal (glTF 2.0, appendix B). The energy of further bounces between microfacets
// is a factor of the lobe (Filament 4.7.2), and the matte part reflects what the dielectric's lobe does
// not; so a white material reflects a uniform environment without loss.

#include <array>

namespace mjsense::render {

using Rgb64 = std::array<double, 3>;

// Smoother surfaces are drawn with this roughness, for which single precision is sufficient.
inline constexpr double kMinRoughness = 0.045;

// The width of GGX's distribution for a perceptual roughness.
double alpha_of(double roughness);

// Reflectance at normal incidence of a dielectric with MuJoCo's `specular`: 0.04 for 0.5.
double dielectric_f0(double specular);

// Roughness and metallic of a material whose fields in MuJoCo are -1 where they are not set: without
// roughness 1 - shininess, without metallic 0.
double roughness_of(double roughness, double shininess);
double metallic_of(double metallic);

struct Substance {
  Rgb64 base;  // linear
  double metallic, roughness;
  double f0;  // of the dielectric
};

// What a substance reflects towards a viewer at N . V.
struct Reflectance {
  Reflectance(const Substance& substance, double n_v);

  Rgb64 matte;    // albedo of the matte part
  Rgb64 f0, f90;  // of the lobe, with the energy of further bounces
  Rgb64 lobe;     // albedo of the lobe
  double alpha, n_v;

  // The BRDF, 1/sr, towards the viewer for light from a direction with these cosines.
  Rgb64 brdf(double n_l, double n_h, double v_h) const;
};

}  // namespace mjsense::render
