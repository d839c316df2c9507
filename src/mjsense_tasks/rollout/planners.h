// SPDX-License-Identifier: Apache-2.0
#pragma once
// Registry of planners by task type, for the policy "planner".

#include <functional>
#include <memory>
#include <string>

#include "mjsense_tasks/episode/policy.h"
#include "mjsense_tasks/episode/task.h"

namespace mjsense::tasks::rollout {

using PlannerFactory = std::function<std::unique_ptr<episode::PlannerPolicy>()>;

// Makes policy "planner" use this factory for tasks of this type (Task::type()). Throws ValueError
// for an empty type or one that has a planner. Thread-safe.
void register_planner(std::string task_type, PlannerFactory make);
// Planner for the task's type, or the picking planner for any other task with a GraspScene. Throws
// ValueError if there is neither.
std::unique_ptr<episode::PlannerPolicy> make_planner(const episode::Task& task);

// Policy that creates its planner with make_planner() in initialize().
std::unique_ptr<episode::Policy> make_any_planner();
// Policy that picks from above in five phases that are the same in every episode, which makes the
// data easy to learn from. Episodes in which nothing can be picked from above use the general
// planner.
std::unique_ptr<episode::Policy> make_top_down_planner();

}  // namespace mjsense::tasks::rollout
