// SPDX-License-Identifier: Apache-2.0
#pragma once
// Description of a measurement. The policy's space, the file on disk and the documentation are
// derived from it.

#include <limits>
#include <string>

#include "mjsense/core/array.h"

namespace mjsense {

// How a recording stores a stream.
enum class Storage {
  kArray,       // a dataset with one row per step
  kRgbVideo,    // uint8 [H, W, 3], row 0 at the top: one MP4 per camera
  kDepthVideo,  // float32 [H, W] in m: one lossless video per camera
};

struct SensorSpec {
  std::string name;  // full name of the stream: "robot/imu_acc", "feet/force", "wrist_camera_depth"
  DType dtype = DType::kFloat32;
  Shape shape;        // of one row, without the dimension B
  std::string unit;   // "m", "rad", "N", "m/s^2"; "": dimensionless
  std::string frame;  // frame in which the row is expressed: "world", "site robot/imu", "pixels";
                      // "" if none
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool is_dict = false;  // the row is JSON text, uint8[str_max_len], padded with 0
  int str_max_len = 0;   // number of bytes of an is_dict row
  Storage storage = Storage::kArray;
  std::string description;  // one sentence: what is measured, with its sign convention
};

}  // namespace mjsense
