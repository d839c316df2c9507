// SPDX-License-Identifier: Apache-2.0
#pragma once
// The simulation object behind mjsense.Simulation.
//
// Memory: arrays handed out share ownership of the simulation, so after close() the memory is freed
// once no array is left.
// Threads: every call releases the GIL and locks the simulation's mutex, so Python threads use it
// one at a time. The mutex is recursive, because a sensor written in Python reads other sensors
// while it is computed. No thread waits for it while holding the GIL.
// Processes: the copy in a forked process throws (process_guard.h).

#include <nanobind/nanobind.h>

#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/sim/simulation.h"
#include "python/bindings/mujoco_callbacks.h"
#include "python/bindings/numpy.h"
#include "python/bindings/process_guard.h"
#include "python/bindings/python_sensor.h"

namespace mjsense::python {

// Serialises access to a simulation and records whether it is working. All Python objects of one
// simulation share one instance.
class SimulationLock {
 public:
  bool is_current() const { return process_.is_current(); }
  // `what` names the call in the error message if user code calls it while the simulation is
  // working.
  template <class Body>
  void change(std::string_view what, Body&& body) {
    process_.check("simulation");
    refuse_python_callbacks();
    nb::gil_scoped_release unlock;
    std::lock_guard lock(mutex_);
    if (depth_ > 0) {
      throw RuntimeError(
          std::string(what) +
          "() was called while the simulation is running: code of a sensor, task or policy may "
          "read sensors and the state, but not step or reset the worlds");
    }
    const Depth in(depth_);
    body();
  }
  template <class Body>
  void read(Body&& body) {
    process_.check("simulation");
    refuse_python_callbacks();
    nb::gil_scoped_release unlock;
    std::lock_guard lock(mutex_);
    const Depth in(depth_);
    body();
  }
  // From the body of a read(): whether it was called by code of a sensor, task or policy.
  bool nested() const { return depth_ > 1; }
  // For code that runs inside the simulation. Must be called without the GIL.
  template <class Body>
  auto work(Body&& body) {
    process_.check("simulation");
    refuse_python_callbacks();
    std::lock_guard lock(mutex_);
    const Depth in(depth_);
    return body();
  }

 private:
  struct Depth {
    explicit Depth(int& depth) : depth(depth) { ++depth; }
    ~Depth() { --depth; }
    int& depth;
  };
  const ProcessGuard process_{};
  std::recursive_mutex mutex_;
  int depth_ = 0;
};

class PySimulation {
 public:
  PySimulation(std::shared_ptr<scene::Scene> scene, int num_worlds, int decimation, int threads,
               std::uint64_t seed) {
    const sim::SimulationCfg cfg{num_worlds, decimation, threads, seed};
    nb::gil_scoped_release unlock;
    sim_ = make_shared_guarded<sim::Simulation>(std::move(scene), cfg);
  }
  // Wraps an existing simulation.
  explicit PySimulation(
      std::shared_ptr<sim::Simulation> sim,
      std::shared_ptr<SimulationLock> sim_lock = std::make_shared<SimulationLock>())
      : sim_(std::move(sim)), sim_lock_(std::move(sim_lock)) {}

  void close() {
    if (!sim_lock_->is_current())
      return sim_.reset();  // in a forked process the copy must not be destroyed
    std::shared_ptr<sim::Simulation> last;
    sim_lock_->change("close", [&] { last = std::move(sim_); });
  }
  bool closed() const { return sim_ == nullptr; }

  // `what` names the call in the error message if user code calls it while the simulation is
  // working.
  template <class Body>
  void change(const char* what, Body&& body) {
    sim_lock_->change(what, [&] {
      body(open());
      // By index, because a notified sensor may add further ones.
      for (std::size_t i = 0; i < python_.size(); ++i) python_[i]->tell_resets();
    });
  }
  template <class Body>
  void read(Body&& body) {
    sim_lock_->read([&] { body(open()); });
  }

  bool nested() const { return sim_lock_->nested(); }

  sim::Simulation& open() const {
    if (!sim_) throw RuntimeError("the simulation is closed");
    return *sim_;
  }
  nb::object owner() const {
    open();
    return owner_of(sim_);
  }
  // Must be called from the body of a change or read.
  void add_python(std::shared_ptr<PythonSensor> sensor) { python_.push_back(std::move(sensor)); }
  const std::vector<std::shared_ptr<PythonSensor>>& python() const { return python_; }

 private:
  std::shared_ptr<sim::Simulation> sim_;
  std::shared_ptr<SimulationLock> sim_lock_ = std::make_shared<SimulationLock>();
  // These sensors are notified of the resets of their worlds (also of failed worlds), even if they
  // are not computed.
  std::vector<std::shared_ptr<PythonSensor>> python_;
};

}  // namespace mjsense::python
