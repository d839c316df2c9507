// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/fields/data_class.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace mjsense {

const DataField& DataClass::field(std::string_view field) const {
  const auto it = std::ranges::find(fields, field, &DataField::name);
  if (it == fields.end())
    throw std::logic_error(std::string(name) + " does not declare " + std::string(field));
  return *it;
}

SensorSpec DataClass::spec(std::string_view name, Shape shape, std::string frame) const {
  const DataField& f = field(name);
  SensorSpec spec;
  spec.dtype = f.dtype;
  spec.shape = shape;
  spec.unit = f.unit;
  spec.frame = std::move(frame);
  spec.description = f.sentence.text();
  return spec;
}

}  // namespace mjsense
