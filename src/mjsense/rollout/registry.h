// SPDX-License-Identifier: Apache-2.0
#pragma once
// The robots (robots/load_robot.h), tasks and policies that have a name: what the program's options
// and Python's strings choose from. Yours join them by register_task() and register_policy(). Each
// make throws KeyError with the nearest names.

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/episode/policy.h"
#include "mjsense/episode/task.h"
#include "mjsense/robots/load_robot.h"

namespace mjsense {

using TaskFactory = std::function<std::unique_ptr<Task>(TaskCfg)>;
using PolicyFactory = std::function<std::unique_ptr<Policy>()>;

// Ours first, then yours in the order in which they came.
std::vector<std::string> task_names();
std::unique_ptr<Task> make_task(std::string_view name, TaskCfg cfg);
// Throws ValueError for a name that is taken, or empty. Any thread may call it.
void register_task(std::string name, TaskFactory make);

std::vector<std::string> policy_names();
std::unique_ptr<Policy> make_policy(std::string_view name);
void register_policy(std::string name, PolicyFactory make);

}  // namespace mjsense
