// SPDX-License-Identifier: Apache-2.0
#pragma once
// Policy "planner": for every task the planner that can do it.

#include <functional>
#include <memory>
#include <string>

#include "mjsense/episode/policy.h"
#include "mjsense/episode/task.h"

namespace mjsense {

using PlannerFactory = std::function<std::unique_ptr<PlannerPolicy>()>;

// From here on policy "planner" does tasks of this type (Task::type()) so. Throws ValueError for a
// type that has a planner, or none. Any thread may call it.
void register_planner(std::string task_type, PlannerFactory make);
// For the task's type; for any other task with a GraspScene the planner that picks. Throws
// ValueError for a task that none can do.
std::unique_ptr<PlannerPolicy> make_planner(const Task& task);

// Becomes, at initialize(), what make_planner() makes for the task.
std::unique_ptr<Policy> make_any_planner();
// Picks from above in five legs that are the same in every episode, where something can be taken so: what is easiest to
// learn from.
std::unique_ptr<Policy> make_top_down_planner();

}  // namespace mjsense
