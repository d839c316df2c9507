// SPDX-License-Identifier: Apache-2.0
#pragma once
// Options of images, declared once for all that make images: camera sensors, recordings and
// renderings of recorded episodes.

#include <optional>

namespace mjsense::sensors {

// Options of colour images that each camera sensor has. A new one is an option of recordings and
// renderings too, and is stored with the settings of a recording.
struct RgbCfg {
  int samples = 1;
  int shadow_samples = 1;
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
