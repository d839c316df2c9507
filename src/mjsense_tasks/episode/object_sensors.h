// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sensors that tasks with objects have in common. They refer to the task, which must outlive them.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "mjsense_tasks/episode/task.h"

namespace mjsense::tasks::episode {

// Pose of the object with this role at the start of the episode, X_WO: float32 [7].
std::shared_ptr<Sensor> start_pose_sensor(const Task& task, const std::string& name,
                                          const std::string& role);
// `grasp_state_<role>`, for all grippers of the robot; null if it has none.
std::shared_ptr<Sensor> grasp_state_sensor(const Task& task, const std::string& role);

// JSON {name: 4x4 nested list}: poses of bodies in the robot's base frame, X_BO, sorted by name.
// Bodies with a negative id are left out.
struct NamedBody {
  std::string name;
  std::function<int(int world)> body;
};
std::shared_ptr<Sensor> body_poses_sensor(const Task& task, const std::string& name,
                                          std::vector<NamedBody> bodies);

}  // namespace mjsense::tasks::episode
