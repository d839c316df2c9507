// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a task is played with where nobody says another: scene, robot, and the time where it is not the robot's.

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

// The robot that plays a task when nobody names another: the usual one if it can, else the first
// that can.
std::string_view default_robot(std::string_view task);

// Sets the horizon, and the periods where the task has its own, of one of our tasks, of
// the first of several; leaves those of others. `cfg.robot` is there, its periods are in `cfg`.
void set_task_defaults(std::string_view task, TaskCfg& cfg);

}  // namespace mjsense
