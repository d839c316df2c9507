// SPDX-License-Identifier: Apache-2.0
#pragma once
// The suite of an episode: what a policy observes and a recording holds, in its published order.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mjsense/episode/task.h"
#include "mjsense/observe/suite.h"
#include "mjsense/rollout/action_log.h"

namespace mjsense {

// A camera that an episode records.
struct RecordedCamera {
  std::string name;         // of its stream: "wrist_camera"
  std::string mjcf_camera;  // full MuJoCo name
  int width = 640, height = 368;
  bool depth = false;
  bool segmentation = false;
  bool image_points = true;  // object_image_points looks through it
  bool erosion = true;       // and keeps off the rim of what it sees
  Sensor* sensor = nullptr;  // of the scene: fields rgb, segmentation, and depth if it is recorded
};

// Per camera [sensor_param_<c>, <c>, <c>_depth, <c>_segmentation], qpos, qvel, robot_base_pose, env_states,
// task_info, actions/*, object_image_points, then the task's, the robot's and the policy's own
// sensors. Names are unique; a clash names both owners. The sensors refer to task, log and cameras,
// which live longer.
// `robot_sensors` are those that the robot has besides its own model's.
SensorSuite core_suite(const Task& task, const ActionLog& log,
                       const std::vector<RecordedCamera>& cameras,
                       std::span<const std::shared_ptr<Sensor>> robot_sensors = {});

}  // namespace mjsense
