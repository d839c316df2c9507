// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/function_sensor.h"
#include "mjsense/observe/pose_sensor.h"
#include "mjsense/robots/grasp_state.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/tasks/pick/pick.h"

namespace mjsense {

std::vector<std::shared_ptr<Sensor>> PickTask::create_task_sensors() const {
  std::vector<GraspStateSensor::Gripper> grippers;
  for (const MoveGroup& group : robot().groups()) {
    if (group.kind == GroupKind::kGripper)
      grippers.push_back({group.name, name_of(model(), mjOBJ_BODY, group.root_body)});
  }
  std::vector<std::shared_ptr<Sensor>> sensors;
  sensors.push_back(std::make_shared<FunctionSensor<float>>(
      "obj_start", pose_spec("world", "Pose of the object when the episode began."),
      [this](const World& world, std::span<float> row) {
        write_pose(start_pose(world.id, kRole), row.data());
      }));
  sensors.push_back(std::make_shared<GraspStateSensor>(
      "grasp_state_" + std::string(kRole),
      BodyRef([this](int world) { return targets_[world].object.body; }), std::move(grippers)));
  sensors.push_back(std::make_shared<FunctionSensor<float>>(
      "obj_end", pose_spec("world", "Pose to which the task wants the object lifted."),
      [this](const World& world, std::span<float> row) {
        write_pose(*goal_pose(world.id, kRole), row.data());
      }));
  return sensors;
}

}  // namespace mjsense
