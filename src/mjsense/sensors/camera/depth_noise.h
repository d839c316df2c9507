// SPDX-License-Identifier: Apache-2.0
#pragma once
// Error model of a stereo depth camera. With focal length f (native pixels) and baseline b:
//   measured  disparity = f b / z + noise, rounded to 1/32 pixel; z = f b / disparity. The standard
//             deviation of z therefore grows with z^2.
//   lost      pixels whose measured depth is below the minimum that the camera can match or above
//             its specified maximum; some of the pixels at jumps in depth, and on surfaces seen
//             edge-on
// A lost pixel is 0.

#include <span>
#include <string_view>

#include "mjsense/core/rng.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"

namespace mjsense::sensors {

struct StereoCamera {
  double baseline;           // m
  double native_width;       // width, in pixels, at which disparities are measured
  double sigma;              // standard deviation of a disparity, native pixels
  double nearest, farthest;  // m, range of measured depth
  double edge_loss;          // probability, next to a jump in depth
  double grazing_loss;       // probability, on a surface steeper than `grazing_slope`
  double grazing_slope;      // tangent of the angle between its normal and the pixel's ray
};

StereoCamera stereo_preset(DepthNoise noise);

// `depth` [height, width]: planar, m, changed in place, 0 where nothing is seen. `fx`: in image
// pixels. `scratch` has the size of `depth`.
void add_stereo_noise(const StereoCamera& camera, std::span<float> depth, int width, double fx,
                      Rng rng, std::span<float> scratch);

}  // namespace mjsense::sensors
