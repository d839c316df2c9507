// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a stereo depth camera makes of true depth. With focal length f (native pixels) and baseline
// b:
//   measured  disparity = f b / z + noise, rounded to 1/32 pixel; z = f b / disparity. So its spread
//             grows with z^2.
//   lost      what is measured nearer than the camera can match or farther than it is sold for; some
//             of the pixels at jumps in depth, and on surfaces seen edge-on
// A lost pixel reads 0.

#include <span>
#include <string_view>

#include "mjsense/core/rng.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"

namespace mjsense {

struct StereoCamera {
  double baseline;           // m
  double native_width;       // pixels that disparities are measured in
  double sigma;              // of a disparity, native pixels
  double nearest, farthest;  // m
  double edge_loss;          // probability, next to a jump in depth
  double grazing_loss;       // probability, on a surface steeper than `grazing_slope`
  double grazing_slope;      // tangent of the angle between its normal and the pixel's ray
};

StereoCamera stereo_preset(DepthNoise noise);

// depth [height, width] planar m, in place, 0 where nothing is; fx in image pixels; scratch as long
// as depth.
void add_stereo_noise(const StereoCamera& camera, std::span<float> depth, int width, double fx,
                      Rng rng, std::span<float> scratch);

}  // namespace mjsense
