// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/object_sensors.h"
#include "mjsense_tasks/tasks/pick_and_place/pick_and_place.h"

namespace mjsense::tasks {

std::vector<std::shared_ptr<Sensor>> PickAndPlaceTask::create_task_sensors() const {
  std::vector<std::shared_ptr<Sensor>> sensors{
      episode::start_pose_sensor(*this, "obj_start", std::string(kObject))};
  for (const std::string_view role : {kObject, kReceptacle}) {
    if (auto grasped = episode::grasp_state_sensor(*this, std::string(role)))
      sensors.push_back(std::move(grasped));
  }
  return sensors;
}

}  // namespace mjsense::tasks
