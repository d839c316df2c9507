#pragma once
// MuJoCo's own sensors: one row of mjData.sensordata, float32 [B, dim].

#include <memory>
#include <string>

#include "mjsense/core/sensor.h"
#include "mjsense/scene/entity.h"

namespace mjsense {

class BuiltinSensor : public Sensor {
 public:
  explicit BuiltinSensor(std::string name) : Sensor(std::move(name)) {}
  std::string_view kind() const override { return "builtin"; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;

 private:
  int adr_ = 0, dim_ = 0;
  Field* field_ = nullptr;
};

}  // namespace mjsense
