// SPDX-License-Identifier: Apache-2.0
#include "mjsense/episode/object_sensors.h"
#include "mjsense/observe/function_sensor.h"
#include "mjsense/observe/pose_sensor.h"
#include "mjsense/tasks/opening/opening.h"

namespace mjsense::tasks {

std::vector<std::shared_ptr<Sensor>> OpeningTask::create_task_sensors() const {
  const std::string role(kRole);
  std::vector<std::shared_ptr<Sensor>> sensors{
      episode::start_pose_sensor(*this, "obj_start", role)};
  if (auto grasped = episode::grasp_state_sensor(*this, role))
    sensors.push_back(std::move(grasped));
  sensors.push_back(std::make_shared<observe::FunctionSensor<float>>(
      "obj_end",
      observe::pose_spec("world", "Pose of the drawer or door where it counts as open or closed."),
      [this](const World& world, std::span<float> row) {
        write_pose(*goal_pose(world.id, kRole), row.data());
      }));
  return sensors;
}

}  // namespace mjsense::tasks
