// SPDX-License-Identifier: Apache-2.0
#pragma once
// A sensor with effects applied. It reads another sensor and has the same fields; the other sensor
// keeps the clean values.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/effects/all_effects.h"
#include "mjsense/effects/chain.h"

namespace mjsense::effects {

struct EffectSensorCfg : SensorCfg {
  std::string sensor;
  Effects effects;
  std::vector<std::string> fields;
  int history_length = 0;
  bool flatten_history = true;

  std::unique_ptr<Sensor> build() const override;
};
template <class V>
void visit_fields(V& v, EffectSensorCfg& c) {
  v.object("EffectSensorCfg",
           "A sensor of the scene with effects (noise, delay and so on) applied; it has the same "
           "fields.",
           "effect")
      .module("effects");
  v.extends(static_cast<SensorCfg&>(c));
  v("sensor", c.sensor, "Name of the clean sensor, such as ``robot/imu_acc``.");
  v("effects", c.effects,
    "The effects, applied in this order; each may be limited to some fields.");
  v("fields", c.fields, "Fields of the clean sensor that are reported; empty: all.");
  v("history_length", c.history_length,
    "Number of rows kept of every field, oldest first; the first row of an episode fills all of "
    "them. 0: no history.")
      .at_least(0);
  v("flatten_history", c.flatten_history, "Return the history as [h d] instead of [h, *shape].");
}

class EffectSensor : public Sensor {
 public:
  // `inner` must be initialized before this sensor and must outlive it. Null: the sensor
  // `cfg.sensor` of the scene.
  explicit EffectSensor(EffectSensorCfg cfg, Sensor* inner = nullptr);

  std::string_view kind() const override { return "effect"; }
  std::vector<std::string> initialization_dependencies() const override;
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;
  void reset(const World& world) override;
  // Delays, drifts and histories must process every control step.
  bool needs_every_step() const override { return needs_every_step_; }
  mjtStage needs() const override { return mjSTAGE_NONE; }  // only rows of another sensor
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
  bool needs_every_step_ = false;
  std::vector<Stream> streams_;
};

}  // namespace mjsense::effects
