// SPDX-License-Identifier: Apache-2.0
#pragma once
// For the tests of observe/: one MuJoCo world from an XML text, and a sensor computed in it.

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "mjsense/core/testing/test_model.h"

namespace mjsense::observe {

class TestWorld : public TestModel {
 public:
  using TestModel::TestModel;
  void compute(Sensor& sensor) {
    sensor.initialize(init());
    sensor.compute(world());
  }
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
