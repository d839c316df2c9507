// SPDX-License-Identifier: Apache-2.0
#pragma once
// Adapter of a sensor written in Python for the simulation. It is computed on the caller's thread,
// for all requested worlds in one call.

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
#include "python/bindings/py_handle.h"

namespace mjsense::python {

// A weak reference to a Python object, because reference cycles through C++ are never collected.
// Any thread may copy and destroy it.
class WeakObject {
 public:
  explicit WeakObject(nb::handle object);
  // Requires the GIL. Throws RuntimeError if the object no longer exists.
  nb::object get() const;

 private:
  std::shared_ptr<nb::weakref> reference_;
};

// Worlds in which a sensor written in Python failed. Python receives the exception of the first
// one.
struct PythonRowError : RowError {
  PythonRowError(std::vector<Fault> faults, PyHandle exception)
      : RowError(std::move(faults)), exception(std::move(exception)) {}
  PyHandle exception;
};

// Declaration of a Python sensor's rows: the fields (none if its value is an arbitrary Python
// object), and whether it is called after every control step.
struct PythonSensorSpec {
  std::vector<std::pair<std::string, SensorSpec>> fields;
  bool updates = false;
};
PythonSensorSpec read_python_spec(nb::handle sensor);
// One field, from a dict.
SensorSpec read_row_spec(nb::handle field);

// Calls _mjs_edit_spec(), _mjs_compute_rows(ids, seeds), _mjs_control_step(ids, dt, seeds) and
// _mjs_reset(ids, seeds) of a mjsense.Sensor (python/mjsense/sensors/sensor.py). The seeds are for random
// numbers drawn in each of these worlds. The Python simulation calls its initialize(sim) once it is
// created. Any thread may call and destroy this object; it acquires the GIL where necessary.
class PythonSensor final : public Sensor, public ControlStepListener {
 public:
  // `self` must be kept alive by the Python scene or simulation that it belongs to.
  PythonSensor(std::string name, WeakObject self, PythonSensorSpec spec)
      : Sensor(std::move(name)), self_(std::move(self)), spec_(std::move(spec)) {}

  std::string_view kind() const override { return "python"; }
  bool updates() const { return spec_.updates; }  // it is called after every control step
  Stage stage() const override { return Stage::kBatch; }
  // The stages that it reads through the Python simulation are computed at the read.
  mjtStage needs() const override { return mjSTAGE_NONE; }
  void edit_spec(mjSpec* spec) override;
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override { draw_seed(world); }
  // Throws PythonRowError with the worlds whose rows could not be computed; the other rows are
  // valid.
  void cast(const CastContext& context) override;
  void control_step(std::span<const int> ids) override { update(ids, step_dt_); }
  // The same for a period of `dt` seconds.
  void update(std::span<const int> ids, double dt);
  void reset(const World& world) override;
  // s, control period from now on
  void set_step_dt(double seconds) { step_dt_ = seconds; }

  // Called with the GIL when the rows exist.
  std::function<void()> on_initialized;
  // Passes the worlds that were reset since the last call to Python. Call without the GIL, which is
  // acquired if there are any.
  void tell_resets();
  nb::object self() const { return self_.get(); }  // requires the GIL

 private:
  void draw_seed(const World& world);
  nb::list seeds_of(std::span<const int> ids) const;
  void flush_resets();  // requires the GIL

  WeakObject self_;
  PythonSensorSpec spec_;
  double step_dt_ = 0;                  // s, control period
  std::vector<std::uint32_t> seeds_;    // [B], at the last compute() or reset()
  std::vector<std::uint32_t> begun_;    // [B], at the last reset()
  std::vector<std::uint64_t> updates_;  // [B], number of updates since then
  std::vector<std::uint8_t> reset_;     // [B], worlds reset since the last call into Python
  std::atomic<bool> any_reset_{false};
};

}  // namespace mjsense::python
