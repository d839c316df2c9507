// SPDX-License-Identifier: Apache-2.0
#pragma once
// A C++ sensor as a Python object.

#include <memory>

#include "mjsense/core/error.h"
#include "mjsense/core/sensor.h"

namespace mjsense::python {

struct SensorHandle {
  std::shared_ptr<Sensor> sensor;  // also keeps its owner alive

  // The sensor as a subclass, for the methods of that class.
  template <class T>
  T& as() const {
    if (auto* typed = dynamic_cast<T*>(sensor.get())) return *typed;
    throw ValueError("sensor '" + sensor->name() + "' is a " + std::string(sensor->kind()) +
                     " sensor: it has no such method");
  }
};

}  // namespace mjsense::python
