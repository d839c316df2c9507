// SPDX-License-Identifier: Apache-2.0
#pragma once
// Options of images, declared once for all that make images: camera sensors, recordings and
// renderings of recorded episodes.

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "mjsense/core/fields/named_enum.h"

namespace mjsense::sensors {

enum class Shading { kClassic, kPbr, kPath };
constexpr std::array<std::string_view, 3> enum_names(Shading) { return {"classic", "pbr", "path"}; }

// As render::ToneMapping.
enum class ToneMap { kNeutral, kFilmic, kLinear, kAgx };
constexpr std::array<std::string_view, 4> enum_names(ToneMap) {
  return {"neutral", "filmic", "linear", "agx"};
}

enum class ExposureMode { kFixed, kAuto };
constexpr std::array<std::string_view, 2> enum_names(ExposureMode) { return {"fixed", "auto"}; }

enum class Imager { kNone, kD435, kZedMini };
constexpr std::array<std::string_view, 3> enum_names(Imager) {
  return {"none", "d435", "zed_mini"};
}

// Options of colour images that each camera sensor has. A new one is an option of recordings and
// renderings too, and is stored with the settings of a recording.
struct RgbCfg {
  int samples = 1;
  int shadow_samples = 1;
  NamedEnum<Shading> shading;
  int samples_per_pixel = 64;
  double exposure = 8;
  NamedEnum<ExposureMode> exposure_mode;
  double exposure_time_constant = 0.5;
  NamedEnum<Imager> imager;
  int motion_samples = 8;
  NamedEnum<ToneMap> tone_mapping = ToneMap::kFilmic;
  double white_balance = 6504;
  std::string environment = "model";
  double environment_intensity = 1;
  double environment_rotation = 0;
  bool ambient_occlusion = true;
};
template <class V>
void visit_fields(V& v, RgbCfg& c) {
  v.object("RgbCfg", "How colour images are computed.");
  v("samples", c.samples,
    "Rays per pixel of rgb; more samples give smoother edges and take longer.")
      .within(1, 64)
      .decides_data();
  v("shadow_samples", c.shadow_samples,
    "Points of each light at which its shadows are computed, within the ball of its "
    "``bulbradius``; more than 1 gives soft shadows and takes longer. A view has at most 32 lights "
    "and points.")
      .within(1, 16)
      .decides_data();
  v("shading", c.shading,
    "classic: MuJoCo's light model. pbr: physically based materials, lights and surroundings; "
    "depth, "
    "segmentation and the other images are the same. path: the same by path tracing, which is the "
    "reference for pbr and takes much longer. The options below belong to pbr and path.")
      .decides_data();
  v("samples_per_pixel", c.samples_per_pixel,
    "Paths per pixel with shading path; four times as many halve the noise. ``samples`` and "
    "``shadow_samples`` are for the other kinds of shading.")
      .within(1, 65536)
      .decides_data();
  v("exposure", c.exposure, "Exposure in EV at ISO 100; 1 more halves the brightness.")
      .within(-10, 30)
      .decides_data();
  v("exposure_mode", c.exposure_mode,
    "auto: a meter chooses the exposure of each world, instead of ``exposure``.")
      .decides_data();
  v("exposure_time_constant", c.exposure_time_constant,
    "Time in which the automatic exposure covers 63 % of a change; 0: it follows at once.")
      .unit("s")
      .within(0, 1e6)
      .decides_data();
  v("imager", c.imager,
    "Colour sensor of a real camera: photon and read noise, vignetting, quantisation, motion blur "
    "and rolling shutter.")
      .decides_data();
  v("motion_samples", c.motion_samples,
    "Instants of an exposure of which an image with ``imager`` is the mean, where something moves; "
    "0: neither motion blur nor rolling shutter.")
      .within(0, 64)
      .decides_data();
  v("tone_mapping", c.tone_mapping,
    "From radiance to colours. neutral: keeps the colours of materials; filmic: soft contrast; "
    "linear: clips; agx: bright colours become white.")
      .decides_data();
  v("white_balance", c.white_balance, "Colour temperature of the light that appears white.")
      .unit("K")
      .within(1667, 25000)
      .decides_data();
  v("environment", c.environment,
    "Light from the surroundings. model: the model's image light, else studio; auto: its image "
    "light, else its skybox, else studio; skybox: its skybox; studio: a neutral bright room; or "
    "the "
    "path of an .hdr or .exr file, which is also the background.")
      .decides_data();
  v("environment_intensity", c.environment_intensity, "Factor of the light from the surroundings.")
      .within(0, 1e6)
      .decides_data();
  v("environment_rotation", c.environment_rotation,
    "Rotation of the surroundings about the world's z axis; a skybox in the background does not "
    "rotate.")
      .unit("degrees")
      .within(-360, 360)
      .decides_data();
  v("ambient_occlusion", c.ambient_occlusion,
    "Darken the light from the surroundings where other geoms are near.")
      .decides_data();
}

// Options of the images of several cameras.
struct ImageCfg : RgbCfg {
  std::optional<int> width, height;
  bool depth = false;
  bool segmentation = false;
  bool shadows = true;
};
template <class V>
void visit_fields(V& v, ImageCfg& c) {
  v.object("ImageCfg", "The images of cameras.");
  v("width", c.width,
    "Width of the images; by default each camera's. ``width`` or ``height`` alone keeps the aspect "
    "ratio.")
      .unit("pixels")
      .at_least(1)
      .decides_data_as("cameras");
  v("height", c.height, "Height of the images; by default each camera's.")
      .unit("pixels")
      .at_least(1)
      .decides_data_as("cameras");
  v("depth", c.depth, "Add a lossless depth image for every camera.").decides_data_as("cameras");
  v("segmentation", c.segmentation,
    "Add a lossless segmentation image for every camera: (id, mjtObj) of each pixel.")
      .decides_data_as("cameras");
  v("shadows", c.shadows, "Draw shadows.").decides_data();
  v.include(static_cast<RgbCfg&>(c));
}

}  // namespace mjsense::sensors
