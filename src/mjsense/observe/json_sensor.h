// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sensors whose row is JSON text, for what is no number: uint8[str_max_len], sorted keys, no blanks,
// padded with 0. The text is written at the moment of sensing, so that what a policy reads and what
// a file holds are the same bytes.

#include <string>

#include "mjsense/core/json.h"
#include "mjsense/core/row_error.h"
#include "mjsense/core/sensor.h"

namespace mjsense {

class JsonSensor : public Sensor {
 public:
  JsonSensor(std::string name, int str_max_len, std::string description, std::string unit = "");
  std::string_view kind() const override { return "json"; }

  void initialize(const SensorInit& init) override;
  // Throws RowError with the sensor, the size and the limit where the text is longer than its row: it
  // is never cut.
  void compute(const World& world) final;

 protected:
  virtual void write(const World& world, JsonWriter& json) = 0;

 private:
  SensorSpec spec_;
};

}  // namespace mjsense
