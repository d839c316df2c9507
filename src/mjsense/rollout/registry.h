// SPDX-License-Identifier: Apache-2.0
#pragma once
// The robots, tasks and policies that have a name: what the program's options and Python's strings
// choose from. Each make throws KeyError with the nearest names.

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/episode/policy.h"
#include "mjsense/episode/task.h"

namespace mjsense {

std::vector<std::string> robot_names();
RobotCfg robot_cfg(std::string_view name);

std::vector<std::string> task_names();
std::unique_ptr<Task> make_task(std::string_view name, TaskCfg cfg);

std::vector<std::string> policy_names();
std::unique_ptr<Policy> make_policy(std::string_view name);

}  // namespace mjsense
