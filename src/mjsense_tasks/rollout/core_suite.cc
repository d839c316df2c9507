// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/core_suite.h"

#include <fmt/format.h>

#include "mjsense/observe/camera_parameters.h"
#include "mjsense/observe/env_states.h"
#include "mjsense/observe/function_sensor.h"
#include "mjsense/observe/image_points.h"
#include "mjsense/observe/joint_state.h"
#include "mjsense/observe/pose_sensor.h"
#include "mjsense/observe/shared_field.h"
#include "mjsense_tasks/episode/policy.h"
#include "mjsense_tasks/robots/finger_grasp.h"
#include "mjsense_tasks/rollout/action_sensors.h"

namespace mjsense::tasks::rollout {
namespace {

constexpr int kTaskInfoLength = 4000;

void add_camera(observe::SensorSuite& suite, const RecordedCamera& camera,
                const std::string& owner) {
  suite.add(std::make_shared<observe::CameraParameterSensor>(
                "sensor_param_" + camera.name, camera.mjcf_camera, camera.width, camera.height),
            owner);
  const auto add = [&](const char* suffix, const char* field) {
    suite.add(observe::field_of_camera(camera.name + suffix, *camera.sensor, field), owner);
  };
  add("", "rgb");
  if (camera.depth) add("_depth", "depth");
  if (camera.segmentation) add("_segmentation", "segmentation");
}

// Sensor for image points of the robot's parts and of the objects with a role in the task. Null if
// there is no such object or no camera.
std::shared_ptr<Sensor> image_points(const episode::Task& task,
                                     const std::vector<RecordedCamera>& cameras) {
  std::vector<observe::ImagePointsSensor::Object> objects = task.robot().image_objects();
  for (std::size_t i = 0; i < task.objects(0).size(); ++i) {
    const episode::TaskObject& object = task.objects(0)[i];
    objects.push_back({object.role, observe::BodyRef([&task, i](int world) {
                         return task.objects(world)[i].body;
                       }),
                       !object.thin});
  }
  std::vector<observe::ImagePointsSensor::Camera> views;
  for (const RecordedCamera& camera : cameras) {
    if (camera.image_points)
      views.push_back(
          {.name = camera.name, .sensor = camera.sensor, .skip_erosion = !camera.erosion});
  }
  if (objects.empty() || views.empty()) return nullptr;
  return std::make_shared<observe::ImagePointsSensor>("object_image_points", std::move(objects),
                                                      std::move(views));
}

}  // namespace

observe::SensorSuite core_suite(const episode::Task& task, const ActionLog& log,
                                const std::vector<RecordedCamera>& cameras,
                                std::span<const std::shared_ptr<Sensor>> robot_sensors) {
  const robots::Robot& robot = task.robot();
  const robots::RobotCfg& cfg = robot.cfg();
  const std::string of_task = fmt::format("task '{}'", task.name());
  observe::SensorSuite suite;
  for (const RecordedCamera& camera : cameras) add_camera(suite, camera, of_task);

  using What = observe::JointStateSensor::What;
  suite.add(
      std::make_shared<observe::JointStateSensor>("qpos", What::kPosition, robot.joint_groups()),
      of_task);
  suite.add(
      std::make_shared<observe::JointStateSensor>("qvel", What::kVelocity, robot.joint_groups()),
      of_task);
  suite.add(
      std::make_shared<observe::FunctionSensor<float>>(
          "robot_base_pose", observe::pose_spec("world", "Pose of the robot's base, on the floor."),
          [&robot](const World& world, std::span<float> row) {
            write_pose(robot.base_pose(world), row.data());
          }),
      of_task);
  // Without a base body everything hangs below the world body, which is not part of the robot.
  const char* base =
      robot.base_body() > 0 ? mj_id2name(task.model(), mjOBJ_BODY, robot.base_body()) : nullptr;
  suite.add(
      std::make_shared<observe::EnvStatesSensor>(
          "env_states", cfg.env_state_name, robot.joint_groups(), cfg.env_state_size,
          base ? base : "", cfg.name,
          observe::Presence{task.absentees(),
                            [&task](int world, int body) { return task.present(world, body); }}),
      of_task);
  suite.add(std::make_shared<observe::JsonFunctionSensor>(
                "task_info", kTaskInfoLength, "The task's information about the state.",
                [&task](const World& world, JsonWriter& json) {
                  json.finite_only().begin_object();
                  task.write_info(world, json);
                  json.end_object();
                }),
            of_task);
  suite.extend(action_sensors(task, log), of_task);
  if (auto points = image_points(task, cameras)) suite.add(std::move(points), of_task);
  suite.extend(task.create_task_sensors(), of_task);
  suite.extend(robot.create_robot_sensors(), fmt::format("robot '{}'", robot.name()));
  suite.extend(robot_sensors, fmt::format("robot '{}'", robot.name()));
  if (!task.objects(0).empty()) {
    suite.extend(robots::finger_grasp_sensors(robot, observe::BodyRef([&task](int world) {
                                                return task.objects(world)[0].body;
                                              })),
                 fmt::format("robot '{}'", robot.name()));
  }
  if (const episode::Policy* policy = task.policy()) {
    suite.extend(policy->create_policy_sensors(), fmt::format("policy '{}'", policy->name()));
  }
  return suite;
}

}  // namespace mjsense::tasks::rollout
