// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/replay_sensor.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

namespace mjsense::tasks::rollout {
namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

SensorSpec spec_of(Shape shape, const char* description) {
  SensorSpec spec;
  spec.dtype = DType::kFloat64;
  spec.shape = shape;
  spec.frame = "world";
  spec.description = description;
  return spec;
}

}  // namespace

ReplaySensor::ReplaySensor(worlds::Worlds& worlds, int ticks)
    : Sensor("replay"), worlds_(worlds), ticks_(ticks) {}

void ReplaySensor::initialize(const SensorInit& init) {
  clear_fields();
  played_.assign(init.num_worlds, {});
  const Shape row{mj_stateSize(init.model, mjSTATE_INTEGRATION)};
  state_ = &add_field("state", spec_of(row, "MuJoCo's state, in the order of mjSTATE_INTEGRATION."),
                      init.num_worlds);
  written_ = &add_field(
      "written",
      spec_of(row, "Values written into the previous state before this step; NaN: not written."),
      init.num_worlds);
  ctrl_ = mocap_ = nullptr;
  if (ticks_ < 2) return;
  ctrl_ = &add_field(
      "ctrl",
      spec_of({ticks_, init.model->nu},
              "Controls at each control tick of the step; NaN at the first observation."),
      init.num_worlds);
  if (init.model->nmocap == 0) return;
  mocap_ = &add_field("mocap",
                      spec_of({ticks_, init.model->nmocap, 7},
                              "Mocap poses, m and wxyz, at each control tick of the step; NaN at "
                              "the first observation."),
                      init.num_worlds);
}

void ReplaySensor::reset(const World& world) {
  for (Field* field : {written_, ctrl_, mocap_}) {
    if (field) std::ranges::fill(field->data.row<double>(world.id), kNothing);
  }
}

void ReplaySensor::compute(const World& world) {
  mj_getState(world.model, world.data, state_->data.row<double>(world.id).data(),
              mjSTATE_INTEGRATION);
}

void ReplaySensor::note_written(std::span<const int> worlds) {
  const ArrayView rows = worlds_.state();
  for (const int w : worlds) {
    const auto* now = reinterpret_cast<const double*>(rows.data + w * rows.strides[0]);
    const std::span<const double> before = state_->data.row<double>(w);
    const std::span<double> written = written_->data.row<double>(w);
    for (std::size_t i = 0; i < written.size(); ++i)
      written[i] = same_bits(now[i], before[i]) ? kNothing : now[i];
  }
}

void ReplaySensor::play(int world, std::span<const double> ctrl, std::span<const double> mocap) {
  played_[world] = {ctrl, mocap};
}

bool ReplaySensor::note_tick(const World& world, int tick) {
  if (!ctrl_ || tick >= ticks_) return false;
  const mjModel* m = world.model;
  const Played& played = played_[world.id];
  if (!played.ctrl.empty()) std::copy_n(&played.ctrl[tick * m->nu], m->nu, world.data->ctrl);
  for (int i = 0; i < m->nmocap && !played.mocap.empty(); ++i) {
    const double* pose = &played.mocap[(tick * m->nmocap + i) * 7];
    std::copy_n(pose, 3, world.data->mocap_pos + 3 * i);
    std::copy_n(pose + 3, 4, world.data->mocap_quat + 4 * i);
  }
  std::copy_n(world.data->ctrl, m->nu, ctrl_->data.row<double>(world.id).data() + tick * m->nu);
  if (!mocap_) return !played.ctrl.empty();
  double* to = mocap_->data.row<double>(world.id).data() + tick * m->nmocap * 7;
  for (int i = 0; i < m->nmocap; ++i, to += 7) {
    std::copy_n(world.data->mocap_pos + 3 * i, 3, to);
    std::copy_n(world.data->mocap_quat + 4 * i, 4, to + 3);
  }
  return !played.ctrl.empty();
}

}  // namespace mjsense::tasks::rollout
