// SPDX-License-Identifier: Apache-2.0
#pragma once
// Prepares views for physically based shading: tables, the environment, exposure and lights.
//
// The unit of MuJoCo's classic colours: emission 1 and a white skybox have the radiance kClassicRadiance,
// and are white in an image with the default exposure. A light of diffuse colour 1 gives a white matte
// surface that faces it kClassicLight of that, as if it had an intensity of 579 lux, because several
// lights and the environment add up.

#include <memory>

#include "mjsense/render/light/environment_light.h"
#include "mjsense/render/light/tone_map.h"
#include "mjsense/render/view/view.h"

namespace mjsense::render {

inline constexpr double kDefaultExposure = 8;  // EV at ISO 100
// cd/m^2 that an image of this exposure shows as 1 (Filament 8.1, S. Lagarde and C. de Rousiers, Moving
// Frostbite to PBR, 2014).
double maximum_radiance(double exposure);
inline constexpr double kClassicRadiance = 1.2 * 256;  // cd/m^2
inline constexpr double kClassicLight = 0.6;

struct PhysicalOptions {
  bool on = false;
  double exposure = kDefaultExposure;
  ToneMapping tone_mapping = ToneMapping::kNeutral;
  double white_balance = kDaylight;  // K
  std::shared_ptr<const Environment> environment;
  bool hides_skybox = false;  // the environment is the background even if there is a skybox
  double environment_intensity = 1;
  double environment_rotation = 0;  // degrees, about the world's z axis
  float occlusion_reach = 0.5f;     // m; 0: no ambient occlusion
  bool follows_image_light =
      false;             // the environment is the model's image light, with its strength
  int path_samples = 0;  // per pixel of path-traced images; 0: images are not path-traced
};

// Factors of the environment for an image light of this colour and intensity, lux: the illuminance of
// a surface in a uniform environment. 1 where the intensity, 0, is not set.
Rgb64 environment_factors(const float diffuse[3], float intensity);

// Sets `out` for a camera whose rotation (R_WC, row-major) is given, except `reflectance`. `tint`:
// environment_factors() of the world's image light.
void set_physical(const PhysicalOptions& options, const Rgb64& tint, const double rotation[9],
                  PhysicalView& out);

// Turns the colours of a classic light into radiance. intensity: in candela, or in lux for a directional
// light; 0: not set. range: m, used with an intensity.
void set_physical(const PhysicalOptions& options, float intensity, float range, ViewLight& light);

}  // namespace mjsense::render
