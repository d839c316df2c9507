// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads NumPy's .npy files, as far as scan tables need it.

#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense::sensors {

// Rows of a C-ordered array of shape (M, 2), little-endian float32 or float64. Throws RuntimeError
// with the place ("sensor 'lidar'"), the file and what was found.
std::vector<std::array<double, 2>> read_npy_pairs(const std::string& path,
                                                  std::string_view context);

}  // namespace mjsense::sensors
