// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sensors that are one function of a world, for values that only a task, a robot or a policy has.

#include <functional>
#include <span>
#include <string>
#include <utility>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/json_sensor.h"

namespace mjsense::observe {

// A row of T values. spec.dtype is set from T. The function must fill the whole row.
template <class T>
class FunctionSensor final : public Sensor {
 public:
  using Fn = std::function<void(const World&, std::span<T>)>;
  FunctionSensor(std::string name, SensorSpec spec, Fn fn)
      : Sensor(std::move(name)), spec_(std::move(spec)), fn_(std::move(fn)) {
    spec_.dtype = dtype_of<T>();
  }
  std::string_view kind() const override { return "function"; }
  void initialize(const SensorInit& init) override {
    clear_fields();
    add_field("", spec_, init.num_worlds);
  }
  void compute(const World& world) override {
    fn_(world, fields()[0].data.template row<T>(world.id));
  }

 private:
  SensorSpec spec_;
  Fn fn_;
};

// A row of JSON text.
class JsonFunctionSensor final : public JsonSensor {
 public:
  using Fn = std::function<void(const World&, JsonWriter&)>;
  JsonFunctionSensor(std::string name, int str_max_len, std::string description, Fn fn)
      : JsonSensor(std::move(name), str_max_len, std::move(description)), fn_(std::move(fn)) {}

 protected:
  void write(const World& world, JsonWriter& json) override { fn_(world, json); }

 private:
  Fn fn_;
};

}  // namespace mjsense::observe
