// SPDX-License-Identifier: Apache-2.0
#pragma once
// For the tests of observe/: one MuJoCo world from an XML text, and a sensor computed in it.

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense::observe {

class TestWorld {
 public:
  explicit TestWorld(const std::string& xml) {
    char error[500] = "";
    mjSpec* spec = mj_parseXMLString(xml.c_str(), nullptr, error, sizeof error);
    model = spec ? mj_compile(spec, nullptr) : nullptr;
    if (!model) throw std::runtime_error(spec ? mjs_getError(spec) : error);
    mj_deleteSpec(spec);
    data = mj_makeData(model);
    mj_forward(model, data);
  }
  ~TestWorld() {
    mj_deleteData(data);
    mj_deleteModel(model);
  }
  SensorInit init(int num_worlds = 1) const { return {.model = model, .num_worlds = num_worlds}; }
  World world(int id = 0) const { return {.id = id, .model = model, .data = data}; }

  void compute(Sensor& sensor) {
    sensor.initialize(init());
    sensor.compute(world());
  }

  mjModel* model = nullptr;
  mjData* data = nullptr;
};

// The text of a JSON row, without its padding.
inline std::string text(const Sensor& sensor, int world = 0) {
  const auto row = sensor.fields()[0].data.row<std::uint8_t>(world);
  std::string out(row.begin(), row.end());
  return out.substr(0, out.find('\0'));
}

template <class T>
std::vector<T> values(const Sensor& sensor, std::string_view field = "", int world = 0) {
  const auto row = sensor.field(field).data.row<T>(world);
  return {row.begin(), row.end()};
}

}  // namespace mjsense::observe
