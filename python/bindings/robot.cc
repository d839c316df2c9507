// SPDX-License-Identifier: Apache-2.0
// Bindings of robots: the contents of a robot.toml, and kinematics of the robot alone.

#include "mjsense_tasks/robots/robot.h"

#include <mujoco/mujoco.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <variant>

#include "mjsense/core/fields/fields.h"
#include "mjsense/core/files/embedded_files.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scene/scene.h"
#include "mjsense_tasks/robots/load_robot.h"
#include "python/bindings/bindings.h"

namespace nb = nanobind;

namespace mjsense::python {
namespace {

using Values = std::vector<std::vector<double>>;

// Name of the kind, e.g. "joint_position".
const char* controller_kind(const tasks::robots::ControllerCfg& cfg) {
  return std::visit([]<class C>(const C&) { return struct_of<C>().kind; }, cfg);
}

// A robot in a scene without other objects.
class PyRobot {
 public:
  explicit PyRobot(const std::string& name_or_path) : cfg_(tasks::robots::robot_cfg(name_or_path)) {
    scene::SceneCfg scene;
    scene::EntityCfg entity;
    entity.model = cfg_.model;
    scene.entities = {{"robot_0", entity}};
    scene_ = std::make_unique<scene::Scene>(std::move(scene));
    robot_ = std::make_unique<tasks::robots::Robot>(cfg_, scene_->model(), 1);
  }

  const tasks::robots::RobotCfg& cfg() const { return cfg_; }
  std::string xml() const { return tasks::robots::robot_xml(cfg_); }

  nb::list groups() const {
    nb::list out;
    const mjModel* m = scene_->model();
    for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
      const tasks::robots::MoveGroup& group = robot_->groups()[g];
      const tasks::robots::MoveGroupCfg& cfg = cfg_.groups[g];
      nb::dict info;
      info["name"] = group.name;
      info["kind"] = std::string(enum_name(group.kind));
      info["joints"] = cfg.joints;
      info["actuators"] = cfg.actuators;
      info["controller"] = std::string(controller_kind(cfg.controller));
      info["num_qpos"] = group.qpos.size();
      info["num_qvel"] = group.dofs.size();
      info["num_commands"] = group.command_size;
      info["command_unit"] = group.command_unit;
      info["command_low"] = group.command_low;
      info["command_high"] = group.command_high;
      std::vector<double> low, high;
      for (int j : group.joints) {
        if (m->jnt_type[j] != mjJNT_HINGE && m->jnt_type[j] != mjJNT_SLIDE) continue;
        const bool limited = m->jnt_limited[j];
        low.push_back(limited ? m->jnt_range[2 * j] : -mjMAXVAL);
        high.push_back(limited ? m->jnt_range[2 * j + 1] : mjMAXVAL);
      }
      info["low"] = low;
      info["high"] = high;
      info["init"] = cfg.init;
      info["leaf_site"] = cfg.leaf_site;
      out.append(info);
    }
    return out;
  }
  nb::list cameras() const {
    nb::list out;
    for (const tasks::robots::CameraMount& camera : cfg_.cameras)
      out.append(nb::make_tuple(camera.name, camera.mjcf_camera, camera.record_depth));
    return out;
  }

  std::vector<double> fk(const std::string& group, const Values& values) const {
    std::vector<double> pose(7);
    write_pose(robot_->fk(robot_->group_index(group), read(values)), pose.data());
    return pose;
  }
  // Returns an empty vector if the pose is not reached.
  std::vector<double> ik(const std::string& group, const std::vector<double>& pose,
                         const Values& values, int max_iterations) const {
    const int g = robot_->group_index(group);
    tasks::robots::RobotValues q = read(values);
    const Pose target{vec3(pose.data()), normalized(quat(pose.data() + 3))};
    if (!robot_->ik(g, target, q, max_iterations)) return {};
    const auto found = q[g].view();
    return {found.begin(), found.end()};
  }

 private:
  tasks::robots::RobotValues read(const Values& values) const {
    tasks::robots::RobotValues q;
    for (std::size_t g = 0; g < values.size(); ++g) q[static_cast<int>(g)].set(values[g]);
    return q;
  }

  tasks::robots::RobotCfg cfg_;
  std::unique_ptr<scene::Scene> scene_;
  std::unique_ptr<tasks::robots::Robot> robot_;
};

}  // namespace

void bind_robot(nb::module_& m) {
  m.def(
      "robot_text",
      [](const std::string& name) {
        return std::string(embedded_file("robots/" + name + "/robot.toml"));
      },
      "The robot.toml of a built-in robot.");
  m.def(
      "robot_python_sensors",
      [](const std::string& name_or_path) {
        nb::list out;
        for (const tasks::robots::PythonSensorRef& sensor :
             tasks::robots::robot_cfg(name_or_path).python_sensors)
          out.append(nb::make_tuple(sensor.name, sensor.class_name, sensor.args));
        return out;
      },
      "(name, 'module:Class', arguments as JSON) of the sensors of a robot that are written in "
      "Python.");
  nb::class_<PyRobot>(m, "Robot", "A robot, as C++ sees it.")
      .def(nb::init<const std::string&>(), nb::arg("name_or_path"))
      .def_prop_ro("name", [](const PyRobot& r) { return r.cfg().name; })
      .def_prop_ro("description", [](const PyRobot& r) { return r.cfg().description; })
      .def_prop_ro("file", [](const PyRobot& r) { return r.cfg().file; })
      .def_prop_ro("base", [](const PyRobot& r) { return r.cfg().base_body; })
      .def_prop_ro("periods_ms",
                   [](const PyRobot& r) {
                     return nb::make_tuple(r.cfg().policy_dt_ms, r.cfg().ctrl_dt_ms,
                                           r.cfg().sim_dt_ms);
                   })
      .def_prop_ro("image_size",
                   [](const PyRobot& r) {
                     return nb::make_tuple(r.cfg().image_width, r.cfg().image_height);
                   })
      .def_prop_ro("xml", &PyRobot::xml)
      .def_prop_ro("groups", &PyRobot::groups)
      .def_prop_ro("cameras", &PyRobot::cameras)
      .def("fk", &PyRobot::fk)
      .def("ik", &PyRobot::ik);
}

}  // namespace mjsense::python
