// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sensor configurations as tables of fields (core/fields/fields.h). SensorKind gives generic code access
// to any kind of sensor.

#include <memory>

#include "mjsense/core/fields/data_class.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/sensor.h"

namespace mjsense {

struct SensorKind {
  const StructDecl* cfg;  // its `kind` equals the sensor's kind()
  const DataClass* data;  // null: the sensor returns a plain array
  SensorCfg* (*base)(void* fields);

  // Creates a default configuration and sets `fields` to the object that its StructDecl describes.
  std::shared_ptr<SensorCfg> make(void** fields) const;
};

template <class Cfg>
SensorKind sensor_kind(const DataClass* data = nullptr) {
  return {&struct_of<Cfg>(), data,
          [](void* fields) -> SensorCfg* { return static_cast<Cfg*>(fields); }};
}

}  // namespace mjsense
