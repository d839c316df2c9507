// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sensors that tasks with objects have in common. They refer to the task, which lives longer.

#include <memory>
#include <string>

#include "mjsense/episode/task.h"

namespace mjsense {

// Pose of the object with this role when the episode began, X_WO: float32 [7].
std::shared_ptr<Sensor> start_pose_sensor(const Task& task, const std::string& name,
                                          const std::string& role);
// `grasp_state_<role>` of every gripper of the robot; null for a robot without one.
std::shared_ptr<Sensor> grasp_state_sensor(const Task& task, const std::string& role);

}  // namespace mjsense
