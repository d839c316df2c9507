// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/contact/contact_field_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "mjsense/sensors/contact/contact_data.h"
#include "mjsense/sensors/contact/contact_fields.h"

namespace mjsense::sensors {

ContactFieldSensor::ContactFieldSensor(ContactSensor* owner, int primary, std::string field)
    : Sensor(fmt::format("{}_{}_{}", owner->name(), owner->primary_names()[primary], field)),
      owner_(owner),
      owner_as_sensor_(owner),
      primary_(primary),
      field_(std::move(field)) {}

void ContactFieldSensor::initialize(const SensorInit& init) {
  clear_fields();
  const bool net = owner_->cfg().reduce == ContactReduce::kNetForce;
  const std::int64_t dim = field_ == "found" || field_ == "dist" ? 1 : 3;
  SensorSpec spec =
      kContactData.spec(field_, {owner_->cfg().num_slots * dim}, contact_field_frame(field_, net));
  if (field_ == "found") spec.low = 0.0;
  add_field("", std::move(spec), init.num_worlds);
}

void ContactFieldSensor::compute(const World& world) {
  const std::span<float> row = fields().front().data.row<float>(world.id);
  const std::size_t dim = row.size() / owner_->cfg().num_slots;
  std::ranges::fill(row, 0.0f);
  const int offset = contact_field_offset(field_);
  ContactReading reading;
  for (int k = 0; k < owner_->cfg().num_slots; ++k) {
    const int found = owner_->read_slot(world, primary_, k, reading);
    if (!found) break;
    for (std::size_t i = 0; i < dim; ++i) {
      row[k * dim + i] =
          static_cast<float>(offset < 0 ? found : contact_values(reading, offset)[i]);
    }
  }
}

}  // namespace mjsense::sensors
