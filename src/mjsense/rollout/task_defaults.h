// SPDX-License-Identifier: Apache-2.0
#pragma once
// The time that tasks are played in, where it is not the robot's and nobody says another.

#include <string_view>

#include "mjsense/episode/task.h"

namespace mjsense {

// Sets the horizon, and the periods where the task has its own, of one of our tasks; leaves those of
// others. `cfg.robot` is there, its periods are in `cfg`.
void set_task_defaults(std::string_view task, TaskCfg& cfg);

}  // namespace mjsense
