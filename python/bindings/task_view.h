// SPDX-License-Identifier: Apache-2.0
#pragma once
// What sensors written in Python learn of the task, the robot and the policy of a rollout.

#include <nanobind/nanobind.h>

#include <memory>

#include "mjsense/rollout/rollout.h"

namespace mjsense::python {

class Turns;

// Outlives its rollout: every call then raises RuntimeError.
class TaskView {
 public:
  // One for all that refer to a rollout: its owner says when it ends.
  using Cell = std::shared_ptr<Rollout*>;
  TaskView(Cell cell, std::shared_ptr<Turns> turns)
      : cell_(std::move(cell)), turns_(std::move(turns)) {}

  Rollout& rollout() const;
  Task& task() const { return rollout().task(); }
  const Robot& robot() const { return rollout().task().robot(); }
  Turns& turns() const { return *turns_; }
  // Throws ValueError for a world that there is not.
  int checked(int world) const;

 private:
  Cell cell_;
  std::shared_ptr<Turns> turns_;  // with the rollout's simulation
};

}  // namespace mjsense::python
