// SPDX-License-Identifier: Apache-2.0
#pragma once
// From linear radiance to colours of a display, in double precision: the reference for the kernels.
// Radiance 1 is white without a curve.

#include "mjsense/render/light/material.h"

namespace mjsense::render {

// IEC 61966-2-1, for values in [0, 1].
double srgb_encode(double linear);
double srgb_decode(double encoded);

// Of linear sRGB.
inline double luminance(const Rgb64& rgb) {
  return 0.2126729 * rgb[0] + 0.7151522 * rgb[1] + 0.0721750 * rgb[2];
}

// Factor of the luminance, cd/m^2, so that 1 is the most that a camera with this exposure (EV at ISO
// 100) can record without clipping: ISO 12232's saturation, as in Filament 8.1.
double exposure_scale(double ev);

inline constexpr double kDaylight = 6504;  // K, the white of sRGB

// Factors of linear sRGB after which light of this colour temperature, K, appears white: von Kries's
// adaptation in Bradford's cone space, applied to white. 1667 to 25000 K; {1, 1, 1} at kDaylight.
Rgb64 white_balance(double kelvin);

// Curves from linear radiance to linear display values in [0, 1].
//   filmic   an S-shaped curve for each channel: K. Narkowicz's fit of ACES, ACES Filmic Tone Mapping
//            Curve (2016), scaled so that middle grey (0.18) stays
//   neutral  Khronos PBR Neutral: colours of materials are kept, highlights are compressed
//   agx      T. Sobotka's AgX, with B. Wrensch's polynomial (2023): highlights lose saturation
double filmic(double x);
Rgb64 neutral(const Rgb64& rgb);
Rgb64 agx(const Rgb64& rgb);

// AgX is agx_linear(kAgxOutset agx_contrast(kAgxInset rgb)).
using Matrix = std::array<Rgb64, 3>;
extern const Matrix kAgxInset, kAgxOutset;
double agx_contrast(double x);
double agx_linear(double x);

}  // namespace mjsense::render
