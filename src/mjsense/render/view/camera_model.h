// SPDX-License-Identifier: Apache-2.0
#pragma once
// Pixel rays from camera parameters.

#include <mujoco/mujoco.h>

#include <array>
#include <span>
#include <vector>

#include "mjsense/render/view/pixel_grid.h"

namespace mjsense::render {

// Square pixels; fovy is that of the image's height: degrees, or metres if orthographic.
PixelGrid grid_from_fovy(int width, int height, double fovy_deg, bool orthographic);

// MuJoCo's physical camera: focal lengths, principal point and sensor size in the same unit of
// length. If the aspect ratios of image and sensor differ, the sensor is cropped about its centre.
PixelGrid grid_from_sensor(int width, int height, const float focal_principal[4],
                           const float sensor_size[2]);

// All parameters in pixels. The image point (u, v), v down, u = 0 at the left border, has the
// direction ((u - cx) / fx, (v - cy) / fy, 1), z forward.
PixelGrid grid_from_intrinsics(int width, int height, double fx, double fy, double cx, double cy);

// The model's camera, as MuJoCo renders it at width x height.
PixelGrid grid_of_camera(const mjModel* model, int camera, int width, int height);

// The intrinsic matrix K, row-major, of the grid without distortion.
std::array<float, 9> intrinsic_matrix(const PixelGrid& grid);

enum class Lens { kBrownConrady, kFisheye };

// The image (x', y'), in CameraSensorCfg's notation, of the direction (x, y, 1) through such a
// lens; x right, y down, z forward.
std::array<double, 2> through_lens(Lens lens, std::span<const double> coefficients, double x,
                                   double y);

// Rays [H, W, 2] for PixelGrid::distorted_rays: the direction of each pixel through a lens with these
// coefficients (defined in CameraSensorCfg). Throws ValueError, with a message that starts with
// `context`, if the lens cannot be inverted over the image or would see 180 degrees.
std::vector<float> distorted_rays(const PixelGrid& grid, Lens lens,
                                  std::span<const double> coefficients, const char* context);

}  // namespace mjsense::render
