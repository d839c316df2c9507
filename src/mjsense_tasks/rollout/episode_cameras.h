// SPDX-License-Identifier: Apache-2.0
#pragma once
// Chooses the cameras of an episode: those of the robot or of a camera system, then those of the
// task. RolloutCfg may select a subset.

#include <string>
#include <vector>

#include "mjsense/sensors/camera/camera_sensor_cfg.h"
#include "mjsense_tasks/cameras/camera_system.h"
#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/rollout/core_suite.h"

namespace mjsense::tasks::rollout {

struct RolloutCfg;

// Camera mounts and image sizes, in the order of a recording. Throws KeyError for an unknown camera
// or system and ValueError for a camera that is named twice.
cameras::CameraSystem choose_cameras(const episode::Task& task, const RolloutCfg& cfg);

// The recorded cameras, and the configuration of the scene's sensor that renders each of them.
std::vector<RecordedCamera> recorded_cameras(const cameras::CameraSystem& system);
sensors::CameraSensorCfg camera_sensor_cfg(const cameras::CameraSystem& system, int camera,
                                           const RecordedCamera& recorded, const RolloutCfg& cfg);

// Centre of the orbits of orbiting cameras: the mean position of the task's objects and the robot's
// grippers. World frame, m.
Vec3 middle_of(const episode::Task& task, const World& world);

// The camera of RolloutCfg::default_view. It must see the robot and the task's objects.
cameras::CameraSystem default_view(const episode::Task& task, const RolloutCfg& cfg);

}  // namespace mjsense::tasks::rollout
