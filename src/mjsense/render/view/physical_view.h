// SPDX-License-Identifier: Apache-2.0
#pragma once
// Input of the render kernels for physically based shading, in the camera's frame.
//
// Radiance is in units of the image's maximum: a surface of radiance 1 is white without tone
// mapping. The exposure is included in all values.

#include <cstdint>

#include "mjsense/render/view/stored_texture.h"

namespace mjsense::render {

enum class ToneMapping : std::uint8_t { kNeutral, kFilmic, kLinear, kAgx };

// The tone curve is a table: value i belongs to the number x for which the bits of x + kOffset as a
// float, shifted right by kShift, are kFirst + i. Between them it is linear. x is in [0, kEnd].
struct ToneCurve {
  static constexpr int kShift = 17;  // 64 values per octave
  static constexpr float kOffset = 1.0f / 1024, kEnd = 31.0f;
  static constexpr int kFirst = (127 - 10) << (23 - kShift);
  static constexpr int kValues = 15 << (23 - kShift);
};

// Albedo of the specular lobe, F0 A + F90 B: A in the low and B in the high 16 bits, as fractions of
// 65535. Rows by perceptual roughness, columns by N . V, both from 0 to 1.
struct SpecularTable {
  static constexpr int kRows = 64, kColumns = 64;
  static constexpr int kStride = kColumns + 1;  // kernels read pairs
};

struct PhysicalView {
  bool on = false;  // otherwise the light model is MuJoCo's classic one
  ToneMapping tone_mapping = ToneMapping::kNeutral;
  const float* tone_curve = nullptr;  // [ToneCurve::kValues]
  // AgX: the curve is applied between two mixtures of the channels (row-major), and then display_curve.
  const float* display_curve = nullptr;
  float agx_inset[9] = {}, agx_outset[9] = {};
  float white[3] = {1, 1, 1};  // factors of the radiance before the tone mapping: white balance
  const std::uint32_t* specular_table = nullptr;  // [kRows, kStride]
  // Radiance of a white matte surface of normal n in the light of the environment: the sum of these
  // coefficients times 1, x, y, z, x^2, y^2, z^2, xy, xz, yz.
  float irradiance[10][3] = {};
  // The environment's radiance by perceptual roughness / (levels - 1), see EnvironmentLight
  const Texture* radiance = nullptr;
  float radiance_scale[3] = {};
  float r_ec[9] = {};              // R_EC, row-major, E: frame of `radiance`
  bool shows_environment = false;  // as the background, instead of a skybox
  float white_radiance = 1;        // cd/m^2 of a radiance of 1
  float unit = 1;         // radiance of a colour of 1 of the skybox, haze, fog and emission
  float reflectance = 0;  // of the mirror
  // The view has all geoms, including those that neither the image nor its shadows show, for path tracing.
  bool all_geoms = false;
  // Distance up to which geoms hide the environment from each other, m; 0: they do not.
  float occlusion_reach = 0;

  bool operator==(const PhysicalView&) const = default;
};

// The geoms that hide the environment, as boxes and as spheres swept in a box. Rows of values by geom, with
// kWindowPadding more entries that kernels may read.
struct OccluderBoxes {
  // R_CB, row-major, -R_CB^T p_CB and half sizes; C is the camera's frame, B the box's.
  static constexpr int kRotation = 0, kOrigin = 9, kHalf = 12;
  // Radius of the sphere (0: a box), 1 / the square of the distance from the surface up to which the geom
  // hides the environment, and a bound: at a distance d from the box it hides at most area / d^2 of the
  // hemisphere (0: nothing).
  static constexpr int kRadius = 15, kFade = 16, kArea = 17;
  static constexpr int kColor = 18;  // the mean colour of its surface, linear
  static constexpr int kRows = 21;
  float* values = nullptr;
  std::size_t stride = 0;

  float* row(int k) const { return values + k * stride; }
};

}  // namespace mjsense::render
