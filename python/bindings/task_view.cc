// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/task_view.h"

#include <fmt/format.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <functional>
#include <utility>
#include <vector>

#include "mjsense/core/text/json.h"
#include "mjsense/scene/resolve.h"
#include "python/bindings/bindings.h"
#include "python/bindings/numpy.h"
#include "python/bindings/py_simulation.h"
#include "python/bindings/python_task.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {
namespace {

void visit(const TaskView& view, int world, std::function<void(const World&)> body) {
  const int id = view.checked(world);
  view.sim_lock().read([&] { view.rollout().for_each(std::span(&id, 1), std::move(body)); });
}

nb::object array_of(std::span<const double> values) {
  auto array = std::make_shared<Array>(DType::kFloat64, Shape{static_cast<int>(values.size())});
  std::ranges::copy(values, array->all<double>().begin());
  return to_numpy(array->view(), owner_of(array));
}

nb::object array_of(const Pose& pose) {
  double row[7];
  write_pose(pose, row);
  return array_of(row);
}

std::string name_of_kind(tasks::robots::GroupKind kind) {
  return std::string(kEnumNames<tasks::robots::GroupKind>[static_cast<std::size_t>(kind)]);
}

nb::list groups(const TaskView& view) {
  const tasks::robots::Robot& robot = view.robot();
  nb::list all;
  for (const tasks::robots::MoveGroup& group : robot.groups()) {
    nb::dict d;
    d["name"] = group.name;
    d["kind"] = name_of_kind(group.kind);
    d["joints"] = group.joints;
    d["qpos"] = group.qpos;
    d["dofs"] = group.dofs;
    d["actuators"] = group.actuators;
    d["leaf_site"] = group.leaf_site;
    d["root_body"] = group.root_body >= 0 ? group.root_body : robot.base_body();
    d["open_command"] = group.open_command;
    d["closed_command"] = group.closed_command;
    d["max_opening"] = group.max_opening;
    d["pad_sites"] = std::vector<int>{group.pad_sites[0], group.pad_sites[1]};
    all.append(d);
  }
  return all;
}

nb::dict targets(const TaskView& view, int world) {
  const tasks::robots::Robot& robot = view.robot();
  const tasks::robots::RobotValues& values = robot.targets(view.checked(world));
  nb::dict d;
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const tasks::robots::MoveGroup& group = robot.groups()[g];
    if (group.target_size > 0) d[group.name.c_str()] = array_of(values[static_cast<int>(g)].view());
  }
  return d;
}

// {group: [x, y, z, qw, qx, qy, qz]} of all groups, in the base frame, m.
nb::dict fk(const TaskView& view, nb::dict values) {
  const tasks::robots::Robot& robot = view.robot();
  tasks::robots::RobotValues q;
  for (auto [name, row] : values) {
    const auto numbers = nb::cast<std::vector<double>>(row);
    q[robot.group_index(nb::cast<std::string>(name))].set(numbers);
  }
  nb::dict d;
  for (std::size_t g = 0; g < robot.groups().size(); ++g)
    d[robot.groups()[g].name.c_str()] = array_of(robot.fk(static_cast<int>(g), q));
  return d;
}

// The action as the policy returned it; None before the first one.
nb::object last_action(const TaskView& view, int world) {
  const tasks::robots::Action* action = view.task().last_action(view.checked(world));
  if (!action) return nb::none();
  nb::dict d;
  for (std::size_t g = 0; g < view.robot().groups().size(); ++g) {
    const tasks::robots::GroupValues& values = action->commands[static_cast<int>(g)];
    if (values.given) d[view.robot().groups()[g].name.c_str()] = array_of(values.view());
  }
  if (action->success) d["success"] = *action->success;
  return d;
}

// The task's information about the state, JSON text.
std::string info(const TaskView& view, int world) {
  std::vector<std::uint8_t> text(1 << 13);
  std::size_t size = 0;
  const auto write = [&](const World& w) {
    JsonWriter json(text);
    json.begin_object();
    view.task().write_info(w, json);
    json.end_object();
    size = json.size();
  };
  visit(view, world, write);
  if (size > text.size()) {
    text.resize(size);
    visit(view, world, write);
  }
  return {text.begin(), text.begin() + static_cast<std::ptrdiff_t>(size)};
}

nb::tuple evaluate(const TaskView& view, int world) {
  tasks::episode::Evaluation e;
  visit(view, world, [&](const World& w) { e = view.task().evaluate(w); });
  // A task that is evaluated after the sensors has not evaluated this observation yet.
  if (view.task().info_follows_evaluation()) e.terminal = view.task().done_received(world);
  return nb::make_tuple(e.reward, e.success, e.terminal, e.truncated);
}

nb::list objects(const TaskView& view, int world) {
  nb::list all;
  const tasks::episode::Task& task = view.task();
  for (const tasks::episode::TaskObject& object : task.objects(view.checked(world)))
    all.append(nb::make_tuple(object.role, scene::name_of(task.model(), mjOBJ_BODY, object.body)));
  return all;
}

nb::object goal_pose(const TaskView& view, int world, const std::string& role) {
  const auto pose = view.task().goal_pose(view.checked(world), role);
  return pose ? array_of(*pose) : nb::none();
}

nb::dict referrals(const TaskView& view, int world) {
  nb::dict d;
  for (const auto& [role, texts] : view.task().referrals(view.checked(world))) {
    nb::list list;
    for (const tasks::episode::Referral& referral : texts)
      list.append(nb::make_tuple(referral.text, referral.probability));
    d[role.c_str()] = list;
  }
  return d;
}

nb::list cameras(const TaskView& view) {
  nb::list all;
  tasks::rollout::Rollout& rollout = view.rollout();
  for (const tasks::rollout::RecordedCamera& camera : rollout.cameras()) {
    nb::dict d;
    d["name"] = camera.name;
    d["mjcf_camera"] = camera.mjcf_camera;
    d["width"] = camera.width;
    d["height"] = camera.height;
    d["depth"] = camera.depth;
    d["sensor"] =
        SensorHandle{std::shared_ptr<Sensor>(rollout.simulation().scene_ptr(), camera.sensor)};
    all.append(d);
  }
  return all;
}

// The object of a task that is written in Python; None for other tasks.
nb::object own(const TaskView& view) {
  const auto* task = dynamic_cast<const PythonTask*>(&view.task());
  return task ? task->object() : nb::none();
}

// Null if the policy has no phases.
const tasks::episode::PlannerPolicy* planner_of(const TaskView& view) {
  return dynamic_cast<const tasks::episode::PlannerPolicy*>(view.task().policy());
}

// (phase, retries, grasp pose); None if the policy has no phases.
nb::object plan(const TaskView& view, int world) {
  const tasks::episode::PlannerPolicy* planner = planner_of(view);
  if (!planner) return nb::none();
  const int w = view.checked(world);
  return nb::make_tuple(planner->phase(w), planner->num_retries(w),
                        array_of(planner->grasp_pose(w)));
}

nb::dict phases(const TaskView& view) {
  nb::dict d;
  if (const tasks::episode::Policy* policy = view.task().policy()) {
    for (const tasks::episode::Phase& phase : policy->phases())
      d[std::string(phase.name).c_str()] = phase.number;
  }
  return d;
}

}  // namespace

tasks::rollout::Rollout& TaskView::rollout() const {
  if (!*cell_) throw RuntimeError("the recording or environment of this task has ended");
  return **cell_;
}

int TaskView::checked(int world) const {
  if (world < 0 || world >= rollout().num_worlds())
    throw ValueError(fmt::format("world {}: must be in [0, {})", world, rollout().num_worlds()));
  return world;
}

void bind_task_view(nb::module_& m) {
  const auto w = nb::arg("world");
  nb::class_<TaskView>(m, "TaskView", "Task, robot and policy of a rollout.")
      .def_prop_ro("name", [](const TaskView& v) { return std::string(v.task().name()); })
      .def_prop_ro("type", [](const TaskView& v) { return std::string(v.task().type()); })
      .def_prop_ro("horizon", [](const TaskView& v) { return v.task().cfg().horizon; })
      .def_prop_ro("policy_dt_ms", [](const TaskView& v) { return v.task().cfg().policy_dt_ms; })
      .def_prop_ro("sim_dt_ms", [](const TaskView& v) { return v.task().cfg().sim_dt_ms; })
      .def_prop_ro("robot_name", [](const TaskView& v) { return v.robot().name(); })
      .def_prop_ro("base_body", [](const TaskView& v) { return v.robot().base_body(); })
      .def_prop_ro("has_policy", [](const TaskView& v) { return v.task().policy() != nullptr; })
      .def_prop_ro("phases", &phases)
      .def_prop_ro("own", &own)
      .def("groups", &groups)
      .def("cameras", &cameras)
      .def("fk", &fk, nb::arg("values"))
      .def("plan", &plan, w)
      .def(
          "step", [](const TaskView& v, int w) { return v.task().episode_step(v.checked(w)); }, w)
      .def(
          "description",
          [](const TaskView& v, int w) { return v.task().description(v.checked(w)); }, w)
      .def("referrals", &referrals, w)
      .def("targets", &targets, w)
      .def("last_action", &last_action, w)
      .def("info", &info, w)
      .def("evaluate", &evaluate, w)
      .def("objects", &objects, w)
      .def(
          "start_pose",
          [](const TaskView& v, int w, const std::string& role) {
            return array_of(v.task().start_pose(v.checked(w), role));
          },
          w, nb::arg("role"))
      .def("goal_pose", &goal_pose, w, nb::arg("role"));
}

}  // namespace mjsense::python
