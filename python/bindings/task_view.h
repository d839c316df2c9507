// SPDX-License-Identifier: Apache-2.0
#pragma once
// Access to the task, robot and policy of a rollout for sensors written in Python.

#include <nanobind/nanobind.h>

#include <memory>

#include "mjsense/rollout/rollout.h"

namespace mjsense::python {

class Turns;

// May outlive its rollout; every call then throws RuntimeError.
class TaskView {
 public:
  // Shared by all objects that refer to a rollout. The owner sets the pointer to null when the
  // rollout ends.
  using Cell = std::shared_ptr<Rollout*>;
  TaskView(Cell cell, std::shared_ptr<Turns> turns)
      : cell_(std::move(cell)), turns_(std::move(turns)) {}

  Rollout& rollout() const;
  Task& task() const { return rollout().task(); }
  const Robot& robot() const { return rollout().task().robot(); }
  Turns& turns() const { return *turns_; }
  // Throws ValueError if there is no such world.
  int checked(int world) const;

 private:
  Cell cell_;
  std::shared_ptr<Turns> turns_;  // shared with the rollout's simulation
};

}  // namespace mjsense::python
