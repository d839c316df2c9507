// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a rollout has of Python's: its worlds there, and code of users that runs for it.

#include <fmt/format.h>
#include <nanobind/nanobind.h>

#include <memory>
#include <string>
#include <type_traits>
#include <typeinfo>
#include <vector>

#include "mjsense/sim/simulation.h"
#include "python/bindings/held.h"
#include "python/bindings/py_simulation.h"
#include "python/bindings/task_view.h"

namespace mjsense::python {

// C++ calls it without the interpreter's lock, except where a function says that it needs it. A task
// or a policy runs on the caller's thread, while the simulation counts as at work: it may read the
// simulation and write its state, but not step or reset it.
class PythonHost : public std::enable_shared_from_this<PythonHost> {
 public:
  explicit PythonHost(nb::object make_simulation) : make_(std::move(make_simulation)) {}

  const std::shared_ptr<Turns>& turns() const { return turns_; }

  // Runs `body` with the interpreter's lock. An exception of Python's comes out as it is, with a note
  // that names `place`: "task 'push': evaluate()".
  template <class Body>
  auto call(const std::string& place, Body&& body) {
    return turns_->work([&] {
      nb::gil_scoped_acquire lock;
      try {
        return body();
      } catch (nb::python_error& error) {
        add_note(error, place);
        throw;
      } catch (const std::bad_cast&) {
        throw ValueError(place + ": what it returned is of another type than expected");
      }
    });
  }

  // The rollout's scene, as `prepared`, which _mjs_scene() of a task or a scene returned, describes
  // it; before simulation(). Needs the lock.
  SceneCfg read_prepared(nb::object prepared);
  // mjsense.Simulation of these worlds, made when it is first wanted. Needs the lock.
  nb::object simulation(const std::shared_ptr<Simulation>& sim);
  // The rollout that is being made, whose task and robot sensors may ask for until it has ended.
  void set_rollout(Rollout& rollout) { *cell_ = &rollout; }
  void end() { *cell_ = nullptr; }
  // Sensors as members of a suite. Needs the lock.
  std::vector<std::shared_ptr<Sensor>> members(nb::handle sensors,
                                               const std::shared_ptr<Simulation>& sim);
  // Nothing of Python's may hold on to a rollout that has ended. Needs the lock.
  void close();

 private:
  static void add_note(nb::python_error& error, const std::string& place);

  std::shared_ptr<Turns> turns_ = std::make_shared<Turns>();
  Held make_, scene_, alive_, simulation_;
  TaskView::Cell cell_ = std::make_shared<Rollout*>(nullptr);
  PySimulation* core_ = nullptr;  // simulation_ keeps it alive
};

// For settings that are optional in Python: an attribute, or what it is without.
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
