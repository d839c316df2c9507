// SPDX-License-Identifier: Apache-2.0
#pragma once
// A sensor written in Python, as the simulation sees it: computed on the caller's thread, for all
// worlds whose rows are wanted at once.

#include <nanobind/nanobind.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/core/control_step.h"
#include "mjsense/core/row_error.h"
#include "mjsense/core/sensor.h"
#include "python/bindings/held.h"

namespace mjsense::python {

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

// Rows that a sensor written in Python could not fill. Python sees the exception of the first world.
struct PythonRowError : RowError {
  PythonRowError(std::vector<Fault> faults, Held exception)
      : RowError(std::move(faults)), exception(std::move(exception)) {}
  Held exception;
};

// What a sensor written in Python declares of its rows: the fields, none if its value is a Python
// object only, and whether it wants to hear of every control step.
struct PythonSensorSpec {
  std::vector<std::pair<std::string, SensorSpec>> fields;
  bool updates = false;
};
PythonSensorSpec read_python_spec(nb::handle sensor);

// Calls _mjs_edit_spec(), _mjs_compute_rows(ids, seeds), _mjs_control_step(ids, dt, seeds) and
// _mjs_reset(ids, seeds) of a mjsense.Sensor (python/mjsense/sensor.py), seeds for the random numbers
// that it draws in each of these worlds; its initialize(sim) is called by the Python simulation, once
// that exists. Any thread may call and destroy this: it takes the interpreter's lock where it needs
// it.
class PythonSensor final : public Sensor, public ControlStepListener {
 public:
  // `self` is kept alive by the Python scene or simulation that it belongs to.
  PythonSensor(std::string name, WeakObject self, PythonSensorSpec spec)
      : Sensor(std::move(name)), self_(std::move(self)), spec_(std::move(spec)) {}

  std::string_view kind() const override { return "python"; }
  Stage stage() const override { return Stage::kBatch; }
  // What it reads of the simulation in Python is brought up to date when it reads it.
  mjtStage needs() const override { return mjSTAGE_NONE; }
  void edit_spec(mjSpec* spec) override;
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override { draw_seed(world); }
  // Throws PythonRowError for the worlds whose rows could not be filled; the others are.
  void cast(const CastContext& context) override;
  void control_step(std::span<const int> ids) override { update(ids, step_dt_); }
  // The same for `dt` seconds.
  void update(std::span<const int> ids, double dt);
  void reset(const World& world) override;

  // Called with the interpreter's lock when the rows exist.
  std::function<void()> on_initialized;
  // Tells Python which worlds were reset since the last call. Without the interpreter's lock, which
  // it takes if there is something to tell.
  void tell_resets();
  nb::object self() const { return self_.get(); }  // needs the lock

 private:
  void draw_seed(const World& world);
  nb::list seeds_of(std::span<const int> ids) const;
  void flush_resets();  // needs the lock

  WeakObject self_;
  PythonSensorSpec spec_;
  double step_dt_ = 0;                  // s, one control step
  std::vector<std::uint32_t> seeds_;    // [B] of the moment of the last compute() or reset()
  std::vector<std::uint32_t> begun_;    // [B] seeds of the last reset()
  std::vector<std::uint64_t> updates_;  // [B] since then
  std::vector<std::uint8_t> reset_;     // [B] worlds reset since the last call into Python
  std::atomic<bool> any_reset_{false};
};

}  // namespace mjsense::python
