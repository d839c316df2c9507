// SPDX-License-Identifier: Apache-2.0
#pragma once
// Adds the sensor's name to errors that a sensor throws.

#include <fmt/format.h>

#include <cstdio>
#include <new>
#include <string>
#include <string_view>

#include "mjsense/core/error.h"
#include "mjsense/core/row_error.h"
#include "mjsense/core/sensor.h"

namespace mjsense::sim {

// A lack of memory in a sensor, with the sensor's name. It allocates nothing.
class SensorOutOfMemory : public std::bad_alloc {
 public:
  explicit SensorOutOfMemory(const Sensor& sensor) {
    std::snprintf(message_, sizeof message_, "sensor '%.80s': out of memory",
                  sensor.name().c_str());
  }
  const char* what() const noexcept override { return message_; }

 private:
  char message_[120];
};

// Runs `body` for a sensor. Errors that do not name the sensor get its name as a prefix.
template <class Body>
void guarded(const Sensor& sensor, Body&& body) {
  try {
    body();
  } catch (const RowError&) {
    throw;  // already names the sensor
  } catch (const Error& e) {
    const std::string named = fmt::format("'{}'", sensor.name());
    if (std::string_view(e.what()).find(named) != std::string_view::npos) throw;
    const std::string message = fmt::format("sensor {}: {}", named, e.what());
    switch (e.kind()) {
      case ErrorKind::kValue:
        throw ValueError(message);
      case ErrorKind::kKey:
        throw KeyError(message);
      case ErrorKind::kRuntime:
        throw RuntimeError(message);
    }
  } catch (const SensorOutOfMemory&) {
    throw;  // already names the sensor
  } catch (const std::bad_alloc&) {
    throw SensorOutOfMemory(sensor);
  }
}

}  // namespace mjsense::sim
