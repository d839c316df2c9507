#include "mjsense/sensors/builtin/builtin.h"

#include <fmt/format.h>

#include "mjsense/scene/resolve.h"
#include "mjsense/scene/scene.h"

namespace mjsense {

std::unique_ptr<Sensor> make_discovered_sensor(const std::string& name) {
  return std::make_unique<BuiltinSensor>(name);
}

void BuiltinSensor::initialize(const SensorInit& init) {
  const int id = resolve(init.model, mjOBJ_SENSOR, name(), fmt::format("sensor '{}'", name()));
  adr_ = init.model->sensor_adr[id];
  dim_ = init.model->sensor_dim[id];
  field_ = &add_field("", {.dtype = DType::kFloat32, .shape = {dim_}}, init.num_worlds);
}

void BuiltinSensor::compute(const World& world) {
  const mjtNum* values = world.data->sensordata + adr_;
  std::span<float> row = field_->data.row<float>(world.id);
  for (int i = 0; i < dim_; ++i) row[i] = static_cast<float>(values[i]);
}

}  // namespace mjsense
