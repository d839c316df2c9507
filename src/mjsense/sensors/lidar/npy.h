// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reading NumPy's .npy files: as much of the format as scan tables need.

#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

// Rows of a C-ordered array of shape (M, 2), little-endian float32 or float64. Throws RuntimeError
// naming the place ("sensor 'lidar'"), the file and what was found.
std::vector<std::array<double, 2>> read_npy_pairs(const std::string& path, std::string_view place);

}  // namespace mjsense
