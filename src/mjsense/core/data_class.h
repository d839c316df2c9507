// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a sensor with several fields returns: one declaration beside the sensor, from which its
// specs, Python's data class and the tables of its page are made.

#include <span>
#include <string>
#include <string_view>

#include "mjsense/core/fields.h"
#include "mjsense/core/spec.h"

namespace mjsense {

struct DataField {
  std::string_view name;
  DType dtype;
  std::string_view shape;  // letters of the page: "B, N, 3"
  std::string_view unit;   // "" dimensionless
  Sentence sentence;
};

struct DataClass {
  std::string_view name;  // in Python
  Sentence sentence;
  std::span<const DataField> fields;

  const DataField& field(std::string_view name) const;  // std::logic_error if undeclared
  // The spec of a row of this shape.
  SensorSpec spec(std::string_view name, Shape shape, std::string frame = "") const;
};

}  // namespace mjsense
