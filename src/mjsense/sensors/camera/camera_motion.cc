// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/camera_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/worlds/step_stages.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::sensors {
namespace {

constexpr double kMaxMoments = 10'000;  // maximum number of positions that are kept

}  // namespace

CameraMotion::CameraMotion(const mjModel* model, const CameraSensorCfg& cfg,
                           const ImagerCfg& imager, const render::MarkerOptions& markers,
                           int num_worlds, int threads, const std::string& context)
    : model_(model),
      width_(cfg.width),
      height_(cfg.height),
      samples_(cfg.motion_samples),
      size_(model->nq + 7 * model->nmocap),
      readout_(imager.readout_time) {
  const double seconds = imager.exposure_time + imager.readout_time;
  const double moments = seconds / model->opt.timestep + 3;
  if (moments > kMaxMoments)
    throw ValueError(fmt::format(
        "{}: exposure_time and readout_time of its image sensor are {:.6g} s together, in which "
        "there are {:.0f} physics steps: with motion_samples the maximum is {:.0f}",
        context, seconds, seconds / model->opt.timestep, kMaxMoments - 3));
  capacity_ = static_cast<int>(moments);
  worlds_.resize(num_worlds);
  for (PerWorld& w : worlds_) {
    w.times.resize(capacity_);
    w.positions.resize(capacity_ * size_);
    w.image.resize(3 * static_cast<std::size_t>(width_) * height_);
  }
  for (int i = 0; i < threads; ++i) data_.emplace_back(call_mujoco(mj_makeData, model));
  markers_.assign(num_worlds, render::Markers(model, markers));
}

void CameraMotion::remember(const World& world) {
  PerWorld& w = worlds_[world.id];
  const mjData* d = world.data;
  // Times increase. A time that is equal or earlier means that the state was written.
  while (w.used > 0 && w.times[slot(w, 0)] >= d->time) {
    w.newest = slot(w, 1);
    --w.used;
  }
  w.newest = slot(w, -1);
  w.used = std::min(w.used + 1, capacity_);
  w.times[w.newest] = d->time;
  mjtNum* to = w.positions.data() + w.newest * size_;
  to = std::copy_n(d->qpos, model_->nq, to);
  to = std::copy_n(d->mocap_pos, 3 * model_->nmocap, to);
  std::copy_n(d->mocap_quat, 4 * model_->nmocap, to);
}

bool CameraMotion::moves(const PerWorld& w, double span) const {
  const double begin = w.times[slot(w, 0)] - span;
  for (int age = 1; age < w.used; ++age) {
    if (std::memcmp(positions(w, age), positions(w, 0), size_ * sizeof(mjtNum)) != 0) return true;
    if (w.times[slot(w, age)] <= begin) return false;
  }
  return false;
}

int CameraMotion::first_instant(const PerWorld& w, int row) const {
  if (w.instants == 1) return 0;
  return static_cast<int>(std::lround(readout_ * (height_ - 1 - row) / (height_ * w.step)));
}

int CameraMotion::plan(const CastContext& context, int world, double exposure_time) {
  PerWorld& w = worlds_[world];
  w.instants = w.count = 1;
  w.step = 0;
  if (!moves(w, exposure_time + readout_)) return 1;
  if (moved_.empty()) {
    moved_.reserve(worlds_.size());
    for (std::size_t i = 0; i < worlds_.size(); ++i)
      moved_.emplace_back(model_, context.rays->shared());
  }
  w.model = context.worlds->model_of(world);
  const double ends = readout_ > 0 ? exposure_time * kMaxEnds / readout_ : samples_;
  w.count = static_cast<int>(std::clamp(ends, 1.0, static_cast<double>(samples_)));
  w.step = ends < 1 ? readout_ / kMaxEnds : exposure_time / w.count;
  w.latest = exposure_time / (2 * w.count);
  w.instants = 2;  // more than 1, for first_instant()
  w.instants = first_instant(w, 0) + w.count;
  return w.instants;
}

CameraMotion::Rows CameraMotion::rows(int world, int i) const {
  const PerWorld& w = worlds_[world];
  Rows rows;
  while (rows.first < height_ && first_instant(w, rows.first) > i) ++rows.first;
  rows.last = rows.first;
  while (rows.last < height_ && first_instant(w, rows.last) + w.count > i) ++rows.last;
  return rows;
}

// Sets the positions at `time`.
void CameraMotion::place(const PerWorld& w, double time, mjData* d) const {
  int age = 0;  // of the last positions at or before `time`
  while (age + 1 < w.used && w.times[slot(w, age)] > time) ++age;
  const mjtNum* from = positions(w, age);
  const mjtNum* mocap = from + model_->nq;
  mju_copy(d->qpos, from, model_->nq);
  mju_copy(d->mocap_pos, mocap, 3 * model_->nmocap);
  mju_copy(d->mocap_quat, mocap + 3 * model_->nmocap, 4 * model_->nmocap);
  const double begin = w.times[slot(w, age)];
  if (age == 0 || time <= begin) return;
  const mjtNum* to = positions(w, age - 1);
  if (std::memcmp(from, to, size_ * sizeof(mjtNum)) == 0) return;
  const double share = (time - begin) / (w.times[slot(w, age - 1)] - begin);
  mj_differentiatePos(model_, d->qvel, 1, from, to);
  mj_integratePos(model_, d->qpos, d->qvel, share);
  const mjtNum* mocap_to = to + model_->nq;
  for (int i = 0; i < 3 * model_->nmocap; ++i)
    d->mocap_pos[i] += share * (mocap_to[i] - d->mocap_pos[i]);
  for (int i = 0; i < model_->nmocap; ++i) {
    mjtNum turn[3];
    mju_subQuat(turn, mocap_to + 3 * model_->nmocap + 4 * i, d->mocap_quat + 4 * i);
    mju_quatIntegrate(d->mocap_quat + 4 * i, turn, share);
  }
}

CameraMotion::Scene CameraMotion::at(int world, int i, int thread) {
  const PerWorld& w = worlds_[world];
  mjData* d = data_[thread].get();
  place(w, w.times[slot(w, 0)] - i * w.step - w.latest, d);
  worlds::all_poses(&w.model, d);
  moved_[world].update(&w.model, d);
  markers_[world].copy(&w.model, d);
  return {moved_[world], markers_[world].all()};
}

void CameraMotion::add(int world, int i, int first, int last, float* mean) const {
  const PerWorld& w = worlds_[world];
  const std::size_t length = 3 * static_cast<std::size_t>(width_);
  const Rows part = rows(world, i);
  for (int y = std::max(first, part.first); y < std::min(last, part.last); ++y) {
    // A running mean, because the mean of equal values is then exactly that value.
    const auto number = static_cast<float>(first_instant(w, y) + w.count - i);
    const float* from = w.image.data() + length * y;
    float* to = mean + length * y;
    if (number == 1) {
      std::copy_n(from, length, to);
    } else {
      for (std::size_t k = 0; k < length; ++k) to[k] += (from[k] - to[k]) / number;
    }
  }
}

}  // namespace mjsense::sensors
