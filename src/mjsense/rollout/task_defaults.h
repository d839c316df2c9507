// SPDX-License-Identifier: Apache-2.0
#pragma once
// The time that tasks are played in, where it is not the robot's and nobody says another.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/episode/task.h"

namespace mjsense {

// The tasks that a name stands for: itself, or of "nav_to_obj+pick" the two. "multi_task" alone is
// that.
std::vector<std::string> parts_of_task(std::string_view name);
// The scene in which one of our tasks plays when nobody names another; "" for others.
std::string_view default_scene(std::string_view task);

// Sets the horizon, and the periods where the task has its own, of one of our tasks, of
// the first of several; leaves those of others. `cfg.robot` is there, its periods are in `cfg`.
void set_task_defaults(std::string_view task, TaskCfg& cfg);

}  // namespace mjsense
