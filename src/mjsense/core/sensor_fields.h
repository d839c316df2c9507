// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sensor configurations as tables of fields: a kind of sensor is what readers know of all of them.

#include <memory>

#include "mjsense/core/data_class.h"
#include "mjsense/core/fields.h"
#include "mjsense/core/sensor.h"

namespace mjsense {

template <class V>
void visit_fields(V& v, SensorCfg& c) {
  v.object("SensorCfg", "Base of the built-in sensor configurations.");
  v("name", c.name, "Name of the sensor in the scene: ``scene[name]``.").required();
}

struct SensorKind {
  const StructDecl* cfg;  // its kind is the sensor's kind()
  const DataClass* data;  // null: a plain array
  SensorCfg* (*base)(void* fields);

  // A default configuration, and where its fields are.
  std::shared_ptr<SensorCfg> make(void** fields) const;
};

template <class Cfg>
SensorKind sensor_kind(const DataClass* data = nullptr) {
  return {&struct_of<Cfg>(), data,
          [](void* fields) -> SensorCfg* { return static_cast<Cfg*>(fields); }};
}

}  // namespace mjsense
