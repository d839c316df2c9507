// SPDX-License-Identifier: Apache-2.0
#pragma once
// The Python side of a rollout: its simulation object, and user code that runs inside the rollout.

#include <fmt/format.h>
#include <nanobind/nanobind.h>

#include <memory>
#include <string>
#include <type_traits>
#include <typeinfo>
#include <vector>

#include "mjsense/sim/simulation.h"
#include "python/bindings/py_handle.h"
#include "python/bindings/py_simulation.h"
#include "python/bindings/task_view.h"

namespace mjsense::python {

// C++ calls it without the GIL, except where a function requires it. Tasks and policies run on the
// caller's thread while the simulation is marked as working: they may read the simulation and write
// its state, but not step or reset it.
class PythonHost : public std::enable_shared_from_this<PythonHost> {
 public:
  explicit PythonHost(nb::object make_simulation) : make_(std::move(make_simulation)) {}

  const std::shared_ptr<SimulationLock>& sim_lock() const { return sim_lock_; }

  // Runs `body` with the GIL. Python exceptions pass through, with a note that names `context`:
  // "task 'push': evaluate()".
  template <class Body>
  auto call(const std::string& context, Body&& body) {
    return sim_lock_->work([&] {
      nb::gil_scoped_acquire lock;
      try {
        return body();
      } catch (nb::python_error& error) {
        add_note(error, context);
        throw;
      } catch (const std::bad_cast&) {
        throw ValueError(context + ": returned a value of an unexpected type");
      }
    });
  }

  // Reads the scene of the rollout from `prepared`, the result of _mjs_scene() of a task or a
  // scene. Call before simulation(). Requires the GIL.
  scene::SceneCfg read_prepared(nb::object prepared);
  // The mjsense.Simulation of these worlds, created on first use. Requires the GIL.
  nb::object simulation(const std::shared_ptr<sim::Simulation>& sim);
  // Sets the rollout under construction. Task and robot sensors may access it until end().
  void set_rollout(tasks::rollout::Rollout& rollout) { *cell_ = &rollout; }
  void end() { *cell_ = nullptr; }
  // Converts Python sensors to members of a suite. Requires the GIL.
  std::vector<std::shared_ptr<Sensor>> members(nb::handle sensors,
                                               const std::shared_ptr<sim::Simulation>& sim);
  // Drops all Python references to the rollout, which has ended. Requires the GIL.
  void close();

 private:
  static void add_note(nb::python_error& error, const std::string& context);

  std::shared_ptr<SimulationLock> sim_lock_ = std::make_shared<SimulationLock>();
  PyHandle make_, scene_, alive_, simulation_;
  TaskView::Cell cell_ = std::make_shared<tasks::rollout::Rollout*>(nullptr);
  PySimulation* core_ = nullptr;  // kept alive by simulation_
};

// Entry of a dict of optional settings, or a default value.
template <class T>
T item_or(nb::handle dict, const char* key, T otherwise) {
  nb::object value = dict.attr("get")(key);
  if (value.is_none()) return otherwise;
  T number{};
  if (nb::try_cast(value, number)) return number;
  throw ValueError(fmt::format("{} is {}: must be {}", key, nb::repr(value).c_str(),
                               std::is_integral_v<T> ? "an int" : "a number"));
}

}  // namespace mjsense::python
