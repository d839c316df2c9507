// SPDX-License-Identifier: Apache-2.0
#pragma once
// The sensor suite of an episode: what a policy observes and a recording stores, in the published
// order.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mjsense/observe/suite.h"
#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/rollout/action_log.h"

namespace mjsense::tasks::rollout {

// A camera that an episode records.
struct RecordedCamera {
  std::string name;         // name of its stream: "wrist_camera"
  std::string mjcf_camera;  // full MuJoCo name
  int width = 640, height = 368;
  bool depth = false;
  bool segmentation = false;
  bool image_points = true;  // used by object_image_points
  bool erosion = true;  // object_image_points excludes points near the borders of the visible area
  // Sensor of the scene with fields rgb, segmentation, and depth if recorded.
  Sensor* sensor = nullptr;
};

// Order: per camera [sensor_param_<c>, <c>, <c>_depth, <c>_segmentation], then qpos, qvel,
// robot_base_pose, env_states, task_info, actions/*, object_image_points, then the sensors of the
// task, the robot and the policy. Names must be unique; the error for a clash names both owners.
// The sensors refer to task, log and cameras, which must outlive them. `robot_sensors`: sensors of
// the robot in addition to those of its model.
observe::SensorSuite core_suite(const episode::Task& task, const ActionLog& log,
                                const std::vector<RecordedCamera>& cameras,
                                std::span<const std::shared_ptr<Sensor>> robot_sensors = {});

}  // namespace mjsense::tasks::rollout
