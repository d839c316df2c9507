// SPDX-License-Identifier: Apache-2.0
#pragma once
// Examples of a kind of sensor in the scene of every_sensor.h, for tests that apply to all sensors.
// Each sensor's folder defines its examples in testing/example.cc.

#include <memory>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense::sensors {

using SensorCfgs = std::vector<std::shared_ptr<const SensorCfg>>;

template <class Cfg, class Fill>
std::shared_ptr<const SensorCfg> example(const char* name, Fill&& fill) {
  auto cfg = std::make_shared<Cfg>();
  cfg->name = name;
  fill(*cfg);
  return cfg;
}

}  // namespace mjsense::sensors
