#pragma once
// A sensor seen through effects. It reads another sensor and has the same fields; the other one
// keeps the clean value.

#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/effects/chain.h"

namespace mjsense {

struct EffectSensorCfg : SensorCfg {
  std::string sensor;               // key of the clean sensor in the same scene: "robot/imu_acc"
  Effects effects;                  // in this order; each may be limited to some fields
  std::vector<std::string> fields;  // of the clean sensor; empty: all
  int history_length = 0;           // rows, oldest first, of every field; 0: none
  bool flatten_history = true;

  std::unique_ptr<Sensor> build() const override;
};

class EffectSensor : public Sensor {
 public:
  // `inner` must be initialized before and live as long; null: the sensor `cfg.sensor` of the
  // scene.
  explicit EffectSensor(EffectSensorCfg cfg, Sensor* inner = nullptr);

  std::string_view kind() const override { return "effect"; }
  std::vector<std::string> reads() const override;
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;
  void reset(const World& world) override;
  // Delays, drifts and histories must see every control step.
  bool eager() const override { return eager_; }
  mjtStage needs() const override { return mjSTAGE_NONE; }  // rows of another sensor
  std::span<Sensor* const> inputs() const override { return {&inner_, 1}; }

  const Sensor& clean() const { return *inner_; }

 private:
  struct Stream {
    const Field* in;
    Field* out;
    EffectChain chain;
  };
  EffectSensorCfg cfg_;
  Sensor* inner_;
  bool eager_ = false;
  std::vector<Stream> streams_;
};

}  // namespace mjsense
