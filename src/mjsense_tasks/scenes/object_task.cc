// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/object_task.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/function_sensor.h"
#include "mjsense/observe/pose_sensor.h"
#include "mjsense_tasks/episode/object_sensors.h"

namespace mjsense::tasks::scenes {

void ObjectTask::begin(const World& world) {
  episode::Task::begin(world);
  subjects_[world.id].start = body_pose(world.data, object(world.id).body);
}

Pose ObjectTask::start_pose(int world, std::string_view role) const {
  if (role != role_) {
    const std::vector<std::string> roles{std::string(role_)};
    throw_unknown(fmt::format("task '{}'", name()), "role", role, roles);
  }
  return start(world);
}

void ObjectTask::begin_with(int body, const std::string& name, bool thin) {
  subjects_.assign(num_worlds(), {{std::string(role_), body, name, thin}, {}});
}

void ObjectTask::set_object(int world, int body, const std::string& name) {
  episode::TaskObject& object = subjects_[world].object;
  object.body = body;
  object.name = name;
}

std::vector<std::shared_ptr<Sensor>> ObjectTask::object_sensors(std::string goal) const {
  const std::string role(role_);
  std::vector<std::shared_ptr<Sensor>> sensors{
      episode::start_pose_sensor(*this, "obj_start", role)};
  if (auto grasped = episode::grasp_state_sensor(*this, role))
    sensors.push_back(std::move(grasped));
  sensors.push_back(std::make_shared<observe::FunctionSensor<float>>(
      "obj_end", observe::pose_spec("world", std::move(goal)),
      [this](const World& world, std::span<float> row) {
        write_pose(*goal_pose(world.id, role_), row.data());
      }));
  return sensors;
}

}  // namespace mjsense::tasks::scenes
