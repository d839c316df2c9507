// SPDX-License-Identifier: Apache-2.0
#pragma once
// What sensors written in Python learn of the task, the robot and the policy of a rollout.

#include <nanobind/nanobind.h>

#include <memory>

#include "mjsense/rollout/rollout.h"

namespace mjsense::python {

// Outlives its rollout: every call then raises RuntimeError.
class TaskView {
 public:
  // One for all that refer to a rollout: its owner says when it ends.
  using Cell = std::shared_ptr<Rollout*>;
  explicit TaskView(Cell cell) : cell_(std::move(cell)) {}

  Rollout& rollout() const;
  Task& task() const { return rollout().task(); }
  const Robot& robot() const { return rollout().task().robot(); }
  // Throws ValueError for a world that there is not.
  int checked(int world) const;

 private:
  Cell cell_;
};

}  // namespace mjsense::python
