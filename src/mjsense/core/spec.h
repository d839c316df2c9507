// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a measurement is, apart from its value: the policy's space, the file on disk and the docs
// are derived from it.

#include <limits>
#include <string>

#include "mjsense/core/array.h"

namespace mjsense {

// How a recording keeps a stream.
enum class Storage {
  kArray,       // a dataset with one row a step
  kRgbVideo,    // uint8 [H, W, 3], row 0 the top: one MP4 a camera
  kDepthVideo,  // float32 [H, W] metres: one lossless video a camera
};

struct SensorSpec {
  std::string name;  // full name of the stream: "robot/imu_acc", "feet/force", "wrist_camera_depth"
  DType dtype = DType::kFloat32;
  Shape shape;        // of one row, without B
  std::string unit;   // "m", "rad", "N", "m/s^2"; "" dimensionless
  std::string frame;  // frame in which the row is expressed: "world", "site robot/imu", "pixels";
                      // "" if none
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool is_dict = false;  // the row is JSON text, uint8[str_max_len], padded with 0
  int str_max_len = 0;   // bytes of an is_dict row
  Storage storage = Storage::kArray;
  std::string description;  // one sentence: what is measured, with its sign
};

}  // namespace mjsense
