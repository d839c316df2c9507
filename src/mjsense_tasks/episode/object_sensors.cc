// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/object_sensors.h"

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/named.h"
#include "mjsense/observe/function_sensor.h"
#include "mjsense/observe/pose_sensor.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/grasp_state.h"

namespace mjsense::tasks::episode {
namespace {

std::size_t index_of(const Task& task, const std::string& role) {
  const std::span<const TaskObject> objects = task.objects(0);
  const TaskObject& object = find_named(objects, &TaskObject::role, role,
                                        "task '" + std::string(task.name()) + "'", "role");
  return static_cast<std::size_t>(&object - objects.data());
}

}  // namespace

std::shared_ptr<Sensor> start_pose_sensor(const Task& task, const std::string& name,
                                          const std::string& role) {
  return std::make_shared<observe::FunctionSensor<float>>(
      name, observe::pose_spec("world", "Pose of the object when the episode began."),
      [&task, role](const World& world, std::span<float> row) {
        write_pose(task.start_pose(world.id, role), row.data());
      });
}

std::shared_ptr<Sensor> grasp_state_sensor(const Task& task, const std::string& role) {
  std::vector<robots::GraspStateSensor::Gripper> grippers;
  for (const robots::MoveGroup& group : task.robot().groups()) {
    if (group.kind == robots::GroupKind::kGripper)
      grippers.push_back({group.name, scene::name_of(task.model(), mjOBJ_BODY, group.root_body)});
  }
  if (grippers.empty()) return nullptr;
  return std::make_shared<robots::GraspStateSensor>(
      "grasp_state_" + role, observe::BodyRef([&task, i = index_of(task, role)](int world) {
        return task.objects(world)[i].body;
      }),
      std::move(grippers));
}

std::shared_ptr<Sensor> body_poses_sensor(const Task& task, const std::string& name,
                                          std::vector<NamedBody> bodies) {
  constexpr int kLength = 2000;
  std::ranges::sort(bodies, {}, &NamedBody::name);
  return std::make_shared<observe::JsonFunctionSensor>(
      name, kLength, "Poses of objects in the robot's base frame: 4x4 matrices by name.",
      [&task, bodies = std::move(bodies)](const World& world, JsonWriter& json) {
        const Pose to_base = inverse(task.robot().base_pose(world));
        json.begin_object();
        for (const NamedBody& one : bodies) {
          const int body = one.body(world.id);
          if (body < 0) continue;
          const Pose pose = to_base * body_pose(world.data, body);
          const Vec3 x = rotate(pose.q, {1, 0, 0}), y = rotate(pose.q, {0, 1, 0}),
                     z = rotate(pose.q, {0, 0, 1});
          json.key(one.name).begin_array();
          for (int i = 0; i < 3; ++i) {
            const double row[4] = {x[i], y[i], z[i], pose.p[i]};
            json.values(row);
          }
          constexpr double kLast[4] = {0, 0, 0, 1};
          json.values(kLast).end_array();
        }
        json.end_object();
      });
}

}  // namespace mjsense::tasks::episode
