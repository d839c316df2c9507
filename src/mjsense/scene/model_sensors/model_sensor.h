// SPDX-License-Identifier: Apache-2.0
#pragma once
// A sensor defined in the MuJoCo model, registered under its full name. The row contains its values
// in mjData.sensordata, as float32 [B, dim]. If the sensor has a history, the field `history` is
// [B, nsample, dim].

#include <string>

#include "mjsense/core/sensor.h"

namespace mjsense::scene {

class ModelSensor : public Sensor {
 public:
  explicit ModelSensor(std::string name) : Sensor(std::move(name)) {}  // full name in the model

  std::string_view kind() const override { return "builtin"; }
  void initialize(const SensorInit& init) override;
  mjtStage needs() const override { return needs_; }
  void compute(const World& world) override;
  void draw(const World& world, DebugShapes& shapes) override;  // draws the frame it is attached to

 private:
  int id_ = -1;
  int adr_ = 0, dim_ = 0;
  mjtStage needs_ = mjSTAGE_ACC;
  int history_adr_ = -1, nsample_ = 0;
  Field* field_ = nullptr;
  Field* history_ = nullptr;
};

}  // namespace mjsense::scene
