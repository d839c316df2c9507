// SPDX-License-Identifier: Apache-2.0
#pragma once
// `sensor_param_<camera>`: extrinsic and intrinsic parameters of a camera, in OpenCV's conventions.

#include <string>

#include "mjsense/core/sensor.h"

namespace mjsense::observe {

// A point p_W (m) is projected to pixel (u, v) = (k0 / k2, k1 / k2) with k = intrinsic_cv *
// extrinsic_cv * [p_W, 1]. u points to the right and v down; (0, 0) is the outer corner of the top
// left pixel. Streams, all float64:
//   <name>/cam2world_gl [4, 4]  X_WC, columns right, down, forward, position. Despite its published
//                               name its axes are OpenCV's (x right, y down, z forward).
//   <name>/extrinsic_cv [3, 4]  world to camera: top rows of the inverse of cam2world_gl
//   <name>/intrinsic_cv [3, 3]  [[f, 0, W/2], [0, f, H/2], [0, 0, 1]], pixels;
//                               f = (H/2) / tan(fovy/2), rounded to float32. If the camera has
//                               sensorsize, focal and principal in its MJCF, fx, fy, cx, cy follow
//                               from these.
class CameraParameterSensor final : public Sensor {
 public:
  // `camera`: full MuJoCo name. `width`, `height`: size of the recorded image, pixels.
  CameraParameterSensor(std::string name, std::string camera, int width, int height);
  std::string_view kind() const override { return "camera_parameters"; }
  mjtStage needs() const override { return mjSTAGE_POS; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;

 private:
  std::string camera_;
  int width_, height_;
  int id_ = -1;
};

}  // namespace mjsense::observe
