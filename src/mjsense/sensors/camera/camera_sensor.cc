// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/camera_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/sensors/camera/camera_workspace.h"

namespace mjsense::sensors {

CameraSensor::CameraSensor(const CameraSensorCfg& cfg) : Sensor(cfg.name), cfg_(cfg) {
  validate(cfg);
}

CameraSensor::~CameraSensor() = default;

bool CameraSensor::wants(std::string_view type) const {
  return std::find(cfg_.data_types.begin(), cfg_.data_types.end(), type) != cfg_.data_types.end();
}

std::string CameraSensor::context() const { return fmt::format("camera '{}'", name()); }

// The camera of the world's `model`, with this configuration's changes, which do not affect other
// sensors of the same camera.
render::PixelGrid CameraSensor::grid_in(const mjModel* model) const {
  const int w = cfg_.width, h = cfg_.height;
  if (cfg_.intrinsics) {
    const CameraIntrinsics& k = *cfg_.intrinsics;
    return render::grid_from_intrinsics(w, h, k.fx, k.fy, k.cx, k.cy);
  }
  const bool wrapped = !cfg_.camera_name.empty();
  if (!wrapped || (!cfg_.fovy && !cfg_.orthographic))
    return render::grid_of_camera(model, camera_, w, h);
  const bool orthographic =
      cfg_.orthographic || model->cam_projection[camera_] == mjPROJ_ORTHOGRAPHIC;
  return render::grid_from_fovy(w, h, cfg_.fovy.value_or(model->cam_fovy[camera_]), orthographic);
}

// Image n is due from phase + n * period on; the first one is also due before that, and at a reset.
bool CameraSensor::is_due(const World& world, std::int64_t& image) const {
  if (cfg_.update_period <= 0) return true;
  // The tolerance avoids that rounding delays an image that is due exactly now.
  const double passed = (world.time() - cfg_.phase) / cfg_.update_period + 1e-6;
  const auto n = std::max<std::int64_t>(-1, static_cast<std::int64_t>(std::floor(passed)));
  const bool due = world.first || n != image;
  image = n;
  return due;
}

void CameraSensor::reset(const World& world) {
  if (optical_flow_) optical_flow_->reset(world.id);
  if (response_) response_->reset(world.id);
  if (motion_) motion_->clear(world.id);
}

void CameraSensor::compute(const World& world) {
  PerWorld& w = worlds_[world.id];
  if (motion_) motion_->remember(world);
  w.due |= is_due(world, w.image);  // an image that was due but not rendered is still due
  if (!w.due) return;
  const mjModel* m = world.model;
  if (!w.grid.distorted_rays) w.grid = grid_in(m);
  if (gl_) {
    gl_->remember(world.id, m);
  } else {
    w.appearance.copy(m);
  }
  w.markers.copy(m, world.data);  // poses of sites, paths of tendons
  if (optical_flow_) optical_flow_->take(world, w.grid);
  w.rng = world.rng(stream_of(name()));
  w.colour_rng = world.rng(stream_of(name() + "/rgb"));
  w.time = world.data->time;  // of the state, which a recording keeps
  std::ranges::copy(render::intrinsic_matrix(w.grid),
                    intrinsics_->data.row<float>(world.id).begin());
  const double* p = world.data->cam_xpos + 3 * camera_;
  const double* r = world.data->cam_xmat + 9 * camera_;
  std::span<float> pose = pose_->data.row<float>(world.id);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose[4 * i + j] = static_cast<float>(r[3 * i + j]);
    pose[4 * i + 3] = static_cast<float>(p[i]);
    pose[12 + i] = 0;
  }
  pose[15] = 1;
}

}  // namespace mjsense::sensors
