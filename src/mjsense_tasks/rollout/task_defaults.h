// SPDX-License-Identifier: Apache-2.0
#pragma once
// Default scene, robot and periods of the built-in tasks.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense_tasks/episode/task.h"

namespace mjsense::tasks::rollout {

// Names of the tasks that a name denotes: itself, or the parts of "nav_to_obj+pick". "multi_task"
// denotes "nav_to_obj+pick".
std::vector<std::string> task_components(std::string_view name);
// Default scene of a built-in task; "" for other tasks.
std::string_view default_scene(std::string_view task);

// Default robot of a task: the usual robot if it can perform the task, otherwise the first one that
// can.
std::string_view default_robot(std::string_view task);

// Sets the horizon of a built-in task (of the first part of a combined one), and its periods if
// they differ from the robot's. Other tasks are left unchanged. `cfg` must already contain the
// robot and its periods.
void set_task_defaults(std::string_view task, episode::TaskCfg& cfg);

}  // namespace mjsense::tasks::rollout
