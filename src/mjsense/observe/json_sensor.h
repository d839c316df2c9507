// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base class of sensors whose row is JSON text, for values that are not numbers:
// uint8[str_max_len], sorted keys, no blanks, padded with 0. The text is written when the sensor is
// computed, so that a policy and a file get the same bytes.

#include <string>

#include "mjsense/core/row_error.h"
#include "mjsense/core/sensor.h"
#include "mjsense/core/text/json.h"

namespace mjsense::observe {

class JsonSensor : public Sensor {
 public:
  JsonSensor(std::string name, int str_max_len, std::string description, std::string unit = "");
  std::string_view kind() const override { return "json"; }

  void initialize(const SensorInit& init) override;
  // Throws RowError with the sensor, the size and the limit if the text is longer than its row. The
  // text is never truncated.
  void compute(const World& world) final;

 protected:
  virtual void write(const World& world, JsonWriter& json) = 0;

 private:
  SensorSpec spec_;
};

}  // namespace mjsense::observe
