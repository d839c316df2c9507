// SPDX-License-Identifier: Apache-2.0
#pragma once
// Tasks and policies by name, for the program's options and for strings in Python (for robots see
// robots/load_robot.h). Users add theirs with register_task() and register_policy(). Unknown names
// throw KeyError with the nearest names.

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense_tasks/episode/policy.h"
#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/robots/load_robot.h"

namespace mjsense::tasks::rollout {

using TaskFactory = std::function<std::unique_ptr<episode::Task>(episode::TaskCfg)>;
using PolicyFactory = std::function<std::unique_ptr<episode::Policy>()>;

// Built-in names first, then registered ones in the order of registration.
std::vector<std::string> task_names();
std::unique_ptr<episode::Task> make_task(std::string_view name, episode::TaskCfg cfg);
// Throws ValueError for a name that is empty or in use. Thread-safe.
void register_task(std::string name, TaskFactory make);

std::vector<std::string> policy_names();
std::unique_ptr<episode::Policy> make_policy(std::string_view name);
void register_policy(std::string name, PolicyFactory make);

}  // namespace mjsense::tasks::rollout
