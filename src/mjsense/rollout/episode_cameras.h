// SPDX-License-Identifier: Apache-2.0
#pragma once
// Which cameras an episode has: the robot's own or those of a system, then the task's; all of them
// or those that are asked for.

#include <string>
#include <vector>

#include "mjsense/cameras/camera_system.h"
#include "mjsense/episode/task.h"
#include "mjsense/rollout/core_suite.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"

namespace mjsense {

struct RolloutCfg;

// Mounts with their sizes, in the order of a recording. Throws KeyError for an unknown camera or
// system, ValueError for a camera that is given twice.
CameraSystem choose_cameras(const Task& task, const RolloutCfg& cfg);

// What is recorded of them, and the sensors of the scene that take the pictures.
std::vector<RecordedCamera> recorded_cameras(const CameraSystem& system);
CameraSensorCfg camera_sensor_cfg(const CameraSystem& system, int camera,
                                  const RecordedCamera& recorded, const RolloutCfg& cfg);

// What orbiting cameras go round: the middle of the task's objects and of the robot's grippers.
Vec3 middle_of(const Task& task, const World& world);

// The camera of RolloutCfg::default_view.
CameraSensorCfg default_view(const Task& task, const RolloutCfg& cfg);

}  // namespace mjsense
