// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/json_sensor.h"

#include <fmt/format.h>

namespace mjsense::observe {

JsonSensor::JsonSensor(std::string name, int str_max_len, std::string description, std::string unit)
    : Sensor(std::move(name)) {
  if (str_max_len < 2) {
    throw ValueError(fmt::format("sensor '{}': str_max_len is {}, must be at least 2 (\"{{}}\")",
                                 this->name(), str_max_len));
  }
  spec_.dtype = DType::kUint8;
  spec_.shape = {str_max_len};
  spec_.unit = std::move(unit);
  spec_.is_dict = true;
  spec_.str_max_len = str_max_len;
  spec_.low = 0;
  spec_.high = 255;
  spec_.description = std::move(description);
}

void JsonSensor::initialize(const SensorInit& init) {
  clear_fields();
  add_field("", spec_, init.num_worlds);
}

void JsonSensor::compute(const World& world) {
  JsonWriter json(fields()[0].data.row<std::uint8_t>(world.id));
  write(world, json);
  if (!json.finish()) {
    throw RowError(world.id,
                   fmt::format("sensor '{}', world {}: its text needs {} bytes, str_max_len is {}",
                               name(), world.id, json.size(), spec_.str_max_len));
  }
}

}  // namespace mjsense::observe
