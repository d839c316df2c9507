// SPDX-License-Identifier: Apache-2.0
#pragma once
// Declares what a sensor with several fields returns. The sensor's specs, Python's data class and
// the tables of the documentation page are generated from it.

#include <span>
#include <string>
#include <string_view>

#include "mjsense/core/sensor_spec.h"
#include "mjsense/core/text/sentence.h"

namespace mjsense {

struct DataField {
  std::string_view name;
  DType dtype;
  std::string_view shape;  // symbolic, as in the documentation: "B, N, 3"
  std::string_view unit;   // "": dimensionless
  Sentence sentence;
};

struct DataClass {
  std::string_view name;  // name in Python
  Sentence sentence;
  std::span<const DataField> fields;

  const DataField& field(std::string_view name) const;  // std::logic_error if undeclared
  // Spec of field `name` for rows of this shape.
  SensorSpec spec(std::string_view name, Shape shape, std::string frame = "") const;
};

}  // namespace mjsense
