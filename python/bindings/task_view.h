// SPDX-License-Identifier: Apache-2.0
#pragma once
// Access to the task, robot and policy of a rollout for sensors written in Python.

#include <nanobind/nanobind.h>

#include <memory>

#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense::python {

class SimulationLock;

// May outlive its rollout; every call then throws RuntimeError.
class TaskView {
 public:
  // Shared by all objects that refer to a rollout. The owner sets the pointer to null when the
  // rollout ends.
  using Cell = std::shared_ptr<tasks::rollout::Rollout*>;
  TaskView(Cell cell, std::shared_ptr<SimulationLock> sim_lock)
      : cell_(std::move(cell)), sim_lock_(std::move(sim_lock)) {}

  tasks::rollout::Rollout& rollout() const;
  tasks::episode::Task& task() const { return rollout().task(); }
  const tasks::robots::Robot& robot() const { return rollout().task().robot(); }
  SimulationLock& sim_lock() const { return *sim_lock_; }
  // Throws ValueError if there is no such world.
  int checked(int world) const;

 private:
  Cell cell_;
  std::shared_ptr<SimulationLock> sim_lock_;  // shared with the rollout's simulation
};

}  // namespace mjsense::python
