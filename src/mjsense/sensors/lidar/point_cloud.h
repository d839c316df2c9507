// SPDX-License-Identifier: Apache-2.0
#pragma once
// Writes point clouds to PLY and PCD files: binary little-endian, x y z in metres and intensity.

#include <span>
#include <string>

namespace mjsense::sensors {

// `points` [N, 3], `intensity` [N] or empty, `distances` [N] or empty. Points without a return
// (distance < 0) are left out. The format follows from the path's ending, .ply or .pcd. Throws
// ValueError for another ending or for sizes that do not match, and RuntimeError if the file cannot
// be written.
void write_point_cloud(const std::string& path, std::span<const float> points,
                       std::span<const float> intensity = {},
                       std::span<const float> distances = {});

}  // namespace mjsense::sensors
