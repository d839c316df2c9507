// SPDX-License-Identifier: Apache-2.0
#pragma once
// Models that tests compile from MJCF text with plain MuJoCo.

#include <mujoco/mujoco.h>

#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/sensor.h"

namespace mjsense {

// Throws RuntimeError with MuJoCo's message.
inline ModelPtr compile_mjcf(const std::string& xml) {
  char error[1000] = "";
  mjSpec* spec = mj_parseXMLString(xml.c_str(), nullptr, error, sizeof error);
  if (spec == nullptr) throw RuntimeError(error);
  ModelPtr model(mj_compile(spec, nullptr));
  const std::string message = model ? "" : mjs_getError(spec);
  mj_deleteSpec(spec);
  if (!model) throw RuntimeError(message);
  return model;
}

// A model with one mjData, whose derived fields are current.
class TestModel {
 public:
  explicit TestModel(const std::string& xml)
      : owned_model_(compile_mjcf(xml)),
        owned_data_(make_data(owned_model_.get())),
        model(owned_model_.get()),
        data(owned_data_.get()) {
    mj_forward(model, data);
  }
  World world(int id = 0) const { return {.id = id, .model = model, .data = data}; }
  SensorInit init(int num_worlds = 1) const { return {.model = model, .num_worlds = num_worlds}; }

 private:
  ModelPtr owned_model_;
  DataPtr owned_data_;

 public:
  mjModel* model;
  mjData* data;
};

}  // namespace mjsense
