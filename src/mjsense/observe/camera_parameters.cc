// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/camera_parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/render/view/camera_model.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::observe {

CameraParameterSensor::CameraParameterSensor(std::string name, std::string camera, int width,
                                             int height)
    : Sensor(std::move(name)), camera_(std::move(camera)), width_(width), height_(height) {
  if (width <= 0 || height <= 0) {
    throw ValueError(fmt::format("sensor '{}': image size {} x {} must be positive", this->name(),
                                 width, height));
  }
}

void CameraParameterSensor::initialize(const SensorInit& init) {
  id_ = scene::resolve(init.model, mjOBJ_CAMERA, camera_, fmt::format("sensor '{}'", name()));
  if (init.model->cam_projection[id_] == mjPROJ_ORTHOGRAPHIC)
    throw ValueError(fmt::format(
        "sensor '{}': camera '{}' is orthographic: it has no pinhole matrix", name(), camera_));
  clear_fields();
  SensorSpec spec;
  spec.dtype = DType::kFloat64;
  spec.shape = {4, 4};
  spec.unit = "m";
  spec.frame = "world";
  spec.description = "Camera to world; columns right, down, forward, position (OpenCV axes).";
  add_field("cam2world_gl", spec, init.num_worlds);
  spec.shape = {3, 4};
  spec.frame = "camera";
  spec.description = "World to camera (OpenCV axes): top rows of the inverse of cam2world_gl.";
  add_field("extrinsic_cv", spec, init.num_worlds);
  spec.shape = {3, 3};
  spec.unit = "px";
  spec.frame = "pixels";
  spec.description = "Pinhole matrix of the image.";
  add_field("intrinsic_cv", spec, init.num_worlds);
}

void CameraParameterSensor::compute(const World& world) {
  const double* R = world.data->cam_xmat + 9 * id_;  // columns: right, up, backward
  const double* p = world.data->cam_xpos + 3 * id_;
  const auto pose = fields()[0].data.row<double>(world.id);
  const auto extrinsic = fields()[1].data.row<double>(world.id);
  const auto intrinsic = fields()[2].data.row<double>(world.id);
  const double sign[3] = {1, -1, -1};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose[4 * i + j] = extrinsic[4 * j + i] = sign[j] * R[3 * i + j];
    pose[4 * i + 3] = p[i];
  }
  for (int j = 0; j < 4; ++j) pose[12 + j] = j == 3;
  for (int i = 0; i < 3; ++i) {
    const double* axis = &extrinsic[4 * i];
    extrinsic[4 * i + 3] = -(axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2]);
  }
  if (world.model->cam_sensorsize[2 * id_ + 1] > 0) {
    const render::PixelGrid grid = render::grid_of_camera(world.model, id_, width_, height_);
    std::ranges::copy(render::intrinsic_matrix(grid), intrinsic.begin());
    return;
  }
  const double fovy = world.model->cam_fovy[id_] * std::numbers::pi / 180.0;
  const double f = static_cast<float>(0.5 * height_ / std::tan(0.5 * fovy));
  const double k[9] = {f, 0, 0.5 * width_, 0, f, 0.5 * height_, 0, 0, 1};
  std::ranges::copy(k, intrinsic.begin());
}

}  // namespace mjsense::observe
