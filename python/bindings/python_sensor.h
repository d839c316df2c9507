// SPDX-License-Identifier: Apache-2.0
#pragma once
// A sensor written in Python, as the simulation sees it: computed for all worlds at once, on the
// caller's thread.

#include <nanobind/nanobind.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense::python {

namespace nb = nanobind;

// A Python object that C++ refers to without keeping it alive, for references in a circle would
// never be freed. May be copied and destroyed by any thread.
class WeakObject {
 public:
  explicit WeakObject(nb::handle object);
  // Needs the interpreter's lock. RuntimeError if the object is gone.
  nb::object get() const;

 private:
  std::shared_ptr<nb::weakref> reference_;
};

// Calls _mjs_edit_spec(), _mjs_compute_rows() and _mjs_reset(ids) of a mjsense.Sensor
// (python/mjsense/sensor.py); its initialize(sim) is called by the Python simulation, once that
// exists. Any thread may call and destroy this: it takes the interpreter's lock where it needs it.
class PythonSensor final : public Sensor {
 public:
  // `spec`: of its one field; without one it has none, and its value is a Python object only.
  // `self` is kept alive by the Python scene or simulation that it belongs to.
  PythonSensor(std::string name, WeakObject self, std::optional<SensorSpec> spec)
      : Sensor(std::move(name)), self_(std::move(self)), spec_(std::move(spec)) {}

  std::string_view kind() const override { return "python"; }
  Stage stage() const override { return Stage::kBatch; }
  // What it reads of the simulation in Python is brought up to date when it reads it.
  mjtStage needs() const override { return mjSTAGE_NONE; }
  void edit_spec(mjSpec* spec) override;
  void initialize(const SensorInit& init) override;
  void compute(const World&) override {}
  void cast(const CastContext& context) override;
  void reset(const World& world) override;

  // Called with the interpreter's lock when the rows exist.
  std::function<void()> on_initialized;
  // Tells Python which worlds were reset since the last call. Needs the interpreter's lock, as does
  // self().
  void flush_resets();
  nb::object self() const { return self_.get(); }

 private:
  WeakObject self_;
  std::optional<SensorSpec> spec_;
  std::vector<std::uint8_t> reset_;  // [B] worlds reset since the last call into Python
  std::atomic<bool> any_reset_{false};
};

// Spec of a mjsense.Sensor's rows from its observation_space, unit and frame; none if it declares
// no space.
std::optional<SensorSpec> read_python_spec(nb::handle sensor);

}  // namespace mjsense::python
