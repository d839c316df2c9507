// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/model_sensors/model_sensor.h"

#include <fmt/format.h>

#include "mjsense/scene/model_sensors/builtin_draw.h"
#include "mjsense/scene/model_sensors/builtin_spec.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scene {

void ModelSensor::initialize(const SensorInit& init) {
  const mjModel* m = init.model;
  id_ = resolve(m, mjOBJ_SENSOR, name(), fmt::format("sensor '{}'", name()));
  adr_ = m->sensor_adr[id_];
  dim_ = m->sensor_dim[id_];
  needs_ = static_cast<mjtStage>(m->sensor_needstage[id_]);
  history_adr_ = m->sensor_historyadr[id_];
  nsample_ = history_adr_ < 0 ? 0 : m->sensor_history[2 * id_];
  SensorSpec spec = describe_builtin(m, id_);
  clear_fields();
  field_ = &add_field("", spec, init.num_worlds);
  if (nsample_ > 0) {
    spec.shape = {nsample_, dim_};
    spec.description = fmt::format("samples of '{}' before its delay, newest first", name());
    history_ = &add_field("history", spec, init.num_worlds);
  }
}

void ModelSensor::compute(const World& world) {
  const mjtNum* values = world.data->sensordata + adr_;
  std::span<float> row = field_->data.row<float>(world.id);
  for (int i = 0; i < dim_; ++i) row[i] = static_cast<float>(values[i]);
  if (nsample_ == 0) return;

  // MuJoCo's ring buffer: [user, index of the newest sample, nsample times, nsample x dim values].
  const mjtNum* ring = world.data->history + history_adr_;
  const int newest = static_cast<int>(ring[1]);
  const mjtNum* samples = ring + 2 + nsample_;
  std::span<float> past = history_->data.row<float>(world.id);
  for (int k = 0; k < nsample_; ++k) {
    const mjtNum* sample = samples + ((newest - k + nsample_) % nsample_) * dim_;
    for (int i = 0; i < dim_; ++i) past[k * dim_ + i] = static_cast<float>(sample[i]);
  }
}

void ModelSensor::draw(const World& world, DebugShapes& shapes) {
  draw_sensor_frame(world, id_, name(), shapes);
}

}  // namespace mjsense::scene
