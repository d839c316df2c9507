// SPDX-License-Identifier: Apache-2.0
#pragma once
// From a camera's parameters to the rays of its pixels.

#include <mujoco/mujoco.h>

#include <array>
#include <span>
#include <vector>

#include "mjsense/render/view/view.h"

namespace mjsense {

// fovy of the image's height, square pixels. fovy_deg: degrees; orthographic: metres.
PixelGrid grid_from_fovy(int width, int height, double fovy_deg, bool orthographic);

// MuJoCo's physical camera: focal lengths, principal point and sensor size in one unit of length.
// If the image has another aspect than the sensor, the sensor is shortened or narrowed around its
// centre.
PixelGrid grid_from_sensor(int width, int height, const float focal_principal[4],
                           const float sensor_size[2]);

// Pixels: image point (u, v), v down, u = 0 the left border, sees along ((u - cx) / fx, (v - cy) /
// fy, 1), z forward.
PixelGrid grid_from_intrinsics(int width, int height, double fx, double fy, double cx, double cy);

// The model's camera as MuJoCo renders it at width x height.
PixelGrid grid_of_camera(const mjModel* model, int camera, int width, int height);

// K, row-major, for the grid without distortion.
std::array<float, 9> intrinsic_matrix(const PixelGrid& grid);

enum class Lens { kBrownConrady, kFisheye };

// Where such a lens puts the image of the direction (x, y, 1), x right, y down, z forward: (x', y')
// of CameraSensorCfg's formulas.
std::array<double, 2> through_lens(Lens lens, std::span<const double> coefficients, double x,
                                   double y);

// [H, W, 2] for PixelGrid::bent: where each pixel looks through a lens with these coefficients
// (CameraSensorCfg says how they are meant). Throws ValueError, beginning with `place`, if the lens
// cannot be inverted over the image or sees 180 degrees.
std::vector<float> bent_rays(const PixelGrid& grid, Lens lens, std::span<const double> coefficients,
                             const char* place);

}  // namespace mjsense
