// SPDX-License-Identifier: Apache-2.0
// Bindings of the core suite's sensors. python/mjsense/sensors/core_sensors.py defines their public
// classes, which resolve names.

#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include "mjsense/observe/camera_parameters.h"
#include "mjsense/observe/env_states.h"
#include "mjsense/observe/image_points.h"
#include "mjsense/observe/joint_state.h"
#include "mjsense/observe/pose_sensor.h"
#include "mjsense/observe/shared_field.h"
#include "mjsense_tasks/robots/grasp_state.h"
#include "python/bindings/bindings.h"
#include "python/bindings/sensor_handle.h"
#include "python/bindings/task_view.h"

namespace mjsense::python {

namespace nb = nanobind;

namespace {

// (name, addresses in qpos, addresses in qvel)
using Group = std::tuple<std::string, std::vector<int>, std::vector<int>>;

std::vector<observe::JointGroup> groups_of(const std::vector<Group>& groups) {
  std::vector<observe::JointGroup> all;
  for (const auto& [name, qpos, dof] : groups) all.push_back({name, qpos, dof});
  return all;
}

SensorHandle joint_state(const std::string& name, bool velocity, const std::vector<Group>& groups) {
  using What = observe::JointStateSensor::What;
  return {std::make_shared<observe::JointStateSensor>(
      name, velocity ? What::kVelocity : What::kPosition, groups_of(groups))};
}

// A frame: (type, name).
using Frame = std::pair<std::string, std::string>;

SensorHandle pose(const std::string& name, const Frame& frame, const Frame& reference,
                  const std::string& description) {
  return {std::make_shared<observe::PoseSensor>(
      name, observe::PoseSensor::Ref{frame.first, frame.second},
      observe::PoseSensor::Ref{reference.first, reference.second}, description)};
}

SensorHandle camera_parameters(const std::string& name, const std::string& camera, int width,
                               int height) {
  return {std::make_shared<observe::CameraParameterSensor>(name, camera, width, height)};
}

SensorHandle env_states(const std::string& name, const std::string& articulation,
                        const std::vector<Group>& groups, int length, const std::string& robot_body,
                        const std::string& robot, const TaskView* view) {
  observe::Presence presence;
  if (view) {
    presence = {view->task().absentees(),
                [task = *view](int world, int body) { return task.task().present(world, body); }};
  }
  return {std::make_shared<observe::EnvStatesSensor>(name, articulation, groups_of(groups), length,
                                                     robot_body, robot, std::move(presence))};
}

SensorHandle grasp_state(const std::string& name, const std::string& object,
                         const std::vector<std::pair<std::string, std::string>>& grippers) {
  std::vector<tasks::robots::GraspStateSensor::Gripper> all;
  for (const auto& [gripper, body] : grippers) all.push_back({gripper, body});
  return {std::make_shared<tasks::robots::GraspStateSensor>(name, observe::BodyRef(object),
                                                            std::move(all))};
}

// objects: (key, body, erode); cameras: (name, sensor of the scene, skip erosion).
SensorHandle image_points(const std::string& name,
                          const std::vector<std::tuple<std::string, std::string, bool>>& objects,
                          nb::list cameras) {
  std::vector<observe::ImagePointsSensor::Object> bodies;
  for (const auto& [key, body, erode] : objects)
    bodies.push_back({key, observe::BodyRef(body), erode});
  std::vector<observe::ImagePointsSensor::Camera> views;
  for (nb::handle camera : cameras) {
    views.push_back({.name = nb::cast<std::string>(camera[0]),
                     .sensor = nb::cast<SensorHandle&>(camera[1]).sensor.get(),
                     .skip_erosion = nb::cast<bool>(camera[2])});
  }
  return {std::make_shared<observe::ImagePointsSensor>(name, std::move(bodies), std::move(views))};
}

SensorHandle shared_field(const std::string& name, const SensorHandle& source,
                          const std::string& field) {
  return {observe::field_of_camera(name, *source.sensor, field)};
}

}  // namespace

void bind_core_sensors(nb::module_& m) {
  m.def("make_joint_state", &joint_state, nb::arg("name"), nb::arg("velocity"), nb::arg("groups"));
  m.def("make_pose", &pose, nb::arg("name"), nb::arg("frame"), nb::arg("reference"),
        nb::arg("description"));
  m.def("make_camera_parameters", &camera_parameters, nb::arg("name"), nb::arg("camera"),
        nb::arg("width"), nb::arg("height"));
  m.def("make_env_states", &env_states, nb::arg("name"), nb::arg("articulation"), nb::arg("groups"),
        nb::arg("length"), nb::arg("robot_body"), nb::arg("robot"), nb::arg("view").none());
  m.def("make_grasp_state", &grasp_state, nb::arg("name"), nb::arg("object"), nb::arg("grippers"));
  m.def("make_image_points", &image_points, nb::arg("name"), nb::arg("objects"),
        nb::arg("cameras"));
  m.def("make_shared_field", &shared_field, nb::arg("name"), nb::arg("source"), nb::arg("field"));
}

}  // namespace mjsense::python
