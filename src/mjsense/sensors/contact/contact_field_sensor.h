// SPDX-License-Identifier: Apache-2.0
#pragma once
// One field of one primary as a separate sensor, named "<sensor>_<primary>_<field>" as in mjlab's
// registry. It is in the contact frame, even if the owner has global_frame.

#include <string>

#include "mjsense/sensors/contact/contact_sensor.h"

namespace mjsense::sensors {

class ContactFieldSensor : public Sensor {
 public:
  // `owner` must outlive this sensor.
  ContactFieldSensor(ContactSensor* owner, int primary, std::string field);

  std::string_view kind() const override { return "contact_field"; }
  mjtStage needs() const override { return owner_->needs(); }
  void initialize(const SensorInit& init) override;  // after the owner is initialized
  void compute(const World& world) override;
  std::span<Sensor* const> inputs() const override { return {&owner_as_sensor_, 1}; }

 private:
  ContactSensor* owner_;
  Sensor* owner_as_sensor_;
  int primary_;
  std::string field_;
};

}  // namespace mjsense::sensors
