// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/sensor.h"

#include <fmt/format.h>

#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"

namespace mjsense {

void Sensor::edit_spec(mjSpec* /*spec*/) {}
std::vector<std::unique_ptr<Sensor>> Sensor::parts() { return {}; }
void Sensor::substep(const World& /*world*/) {}
void Sensor::cast(const CastContext& /*context*/) {}
void Sensor::reset(const World& /*world*/) {}
void Sensor::draw(const World& /*world*/, DebugShapes& /*shapes*/) {
  throw ValueError(
      fmt::format("sensor '{}': sensors of kind '{}' have nothing to draw", name_, kind()));
}

const Field& Sensor::field(std::string_view name) const {
  return find_named(fields_, &Field::name, name, fmt::format("sensor '{}'", name_), "field");
}

std::size_t Sensor::bytes_per_world() const {
  std::size_t n = 0;
  for (const Field& f : fields_) n += f.data.row_bytes();
  return n;
}

Field& Sensor::add_field(std::string_view name, SensorSpec spec, int num_worlds) {
  spec.name = name.empty() ? name_ : fmt::format("{}/{}", name_, name);
  Array data(spec.dtype, spec.shape.with_front(num_worlds));
  return fields_.emplace_back(Field{std::string(name), std::move(spec), std::move(data)});
}

Field& Sensor::share_field(std::string_view name, SensorSpec spec, Field& source) {
  spec.name = name.empty() ? name_ : fmt::format("{}/{}", name_, name);
  Array data =
      Array::shared(source.data, spec.dtype, spec.shape.with_front(source.data.shape()[0]));
  return fields_.emplace_back(Field{std::string(name), std::move(spec), std::move(data)});
}

}  // namespace mjsense
