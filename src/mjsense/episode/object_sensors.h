// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sensors that tasks with objects have in common. They refer to the task, which lives longer.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/episode/task.h"

namespace mjsense {

// Pose of the object with this role when the episode began, X_WO: float32 [7].
std::shared_ptr<Sensor> start_pose_sensor(const Task& task, const std::string& name,
                                          const std::string& role);
// `grasp_state_<role>` of every gripper of the robot; null for a robot without one.
std::shared_ptr<Sensor> grasp_state_sensor(const Task& task, const std::string& role);

// JSON {name: 4x4 nested list}: poses of bodies in the robot's base frame, X_BO, names sorted. A
// body < 0 is left out.
struct NamedBody {
  std::string name;
  std::function<int(int world)> body;
};
std::shared_ptr<Sensor> body_poses_sensor(const Task& task, const std::string& name,
                                          std::vector<NamedBody> bodies);

}  // namespace mjsense
