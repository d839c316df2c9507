// SPDX-License-Identifier: Apache-2.0
#pragma once
// Point clouds on disk: PLY and PCD, binary little-endian, x y z in metres and intensity.

#include <span>
#include <string>

namespace mjsense {

// points [N, 3], intensity [N] or empty, distances [N] or empty: points without a return (distance
// < 0) are left out. The format is the path's ending, .ply or .pcd; ValueError for another,
// RuntimeError if the file cannot be written.
void write_point_cloud(const std::string& path, std::span<const float> points,
                       std::span<const float> intensity = {},
                       std::span<const float> distances = {});

}  // namespace mjsense
