// SPDX-License-Identifier: Apache-2.0
#pragma once
// Declares the fields of an IMU.

#include "mjsense/core/fields/data_class.h"

namespace mjsense::sensors {

// clang-format off
inline constexpr DataField kImuDataFields[] = {
  {"acc", DType::kFloat32, "B, 3", "m/s^2", "Specific force: +9.81 along up at rest, 0 in free fall."},
  {"gyro", DType::kFloat32, "B, 3", "rad/s", "Angular velocity."},
  {"quat", DType::kFloat32, "B, 4", "", "Orientation (wxyz) of the site in the world; with orientation=True."},
};
// clang-format on

inline constexpr DataClass kImuData{"ImuData", "In the axes of the site.", kImuDataFields};

}  // namespace mjsense::sensors
