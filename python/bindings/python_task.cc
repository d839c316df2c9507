// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/python_task.h"

#include <fmt/format.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/observe/suite.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/episode/object_sensors.h"

namespace mjsense::python {
namespace {

using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Bools = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Position (m) and quaternion (wxyz) from a sequence of 7 numbers.
Pose read_pose(nb::handle value, const std::string& context) {
  const auto numbers = nb::cast<std::vector<double>>(value);
  if (numbers.size() != 7) {
    throw ValueError(fmt::format("{} returned {}, a pose has 7: position and quaternion", context,
                                 counted(numbers.size(), "number")));
  }
  return {vec3(numbers.data()), quat(numbers.data() + 3)};
}

std::string last_part(const std::string& name) { return name.substr(name.rfind('/') + 1); }

}  // namespace

PythonTask::PythonTask(tasks::episode::TaskCfg cfg, nb::object task,
                       std::shared_ptr<PythonHost> host)
    : tasks::episode::Task(std::move(cfg)), task_(std::move(task)), host_(std::move(host)) {}

std::unique_ptr<PythonTask> PythonTask::make(nb::object task, std::shared_ptr<PythonHost> host,
                                             tasks::episode::TaskCfg cfg, bool own_horizon) {
  nb::object settings = task.attr("_mjs_settings")();
  if (!cfg.scene.empty() || cfg.make_scene) {
    throw ValueError(fmt::format("task '{}' makes its scene itself: it cannot take the scene '{}'",
                                 nb::cast<std::string>(settings["name"]), cfg.scene));
  }
  cfg.policy_dt_ms = item_or(settings, "policy_dt_ms", cfg.policy_dt_ms);
  const int of_robot = cfg.sim_dt_ms;
  cfg.sim_dt_ms = item_or(settings, "sim_dt_ms", cfg.sim_dt_ms);
  // The controllers' period is the robot's unless the task changes the physics timestep.
  cfg.ctrl_dt_ms = item_or(settings, "ctrl_dt_ms", cfg.sim_dt_ms == of_robot ? cfg.ctrl_dt_ms : 0);
  if (own_horizon) cfg.horizon = item_or(settings, "horizon", cfg.horizon);
  std::unique_ptr<PythonTask> made(
      new PythonTask(std::move(cfg), std::move(task), std::move(host)));
  made->name_ = nb::cast<std::string>(settings["name"]);
  made->type_ = nb::cast<std::string>(settings["task_type"]);
  made->robot_entity_ = nb::cast<std::string>(settings["robot_entity"]);
  made->table_height_ = nb::cast<double>(settings["table_height"]);
  made->groups_ = nb::cast<tasks::robots::ActuatorGroups>(settings["move_groups"]);
  for (const auto& [name, camera] :
       nb::cast<std::vector<std::pair<std::string, std::string>>>(settings["cameras"])) {
    made->cameras_.push_back({.name = name, .mjcf_camera = camera});
  }
  return made;
}

std::string PythonTask::place(const char* method) const {
  return fmt::format("task '{}': {}()", name_, method);
}

scene::SceneCfg PythonTask::scene_cfg() const {
  return call("scene", [&] { return host_->read_prepared(task_.get().attr("_mjs_scene")()); });
}

void PythonTask::initialize_task() {
  const auto sim = simulation_.lock();
  if (!sim)
    throw RuntimeError(fmt::format("task '{}' is written in Python: it needs a Rollout", name_));
  found_.assign(num_worlds(), {});
  objects_.assign(num_worlds(), {});
  starts_.assign(num_worlds(), {});
  target_.assign(num_worlds(), 0);
  call("initialize", [&] {
    nb::list groups;
    for (const tasks::robots::MoveGroup& group : robot().groups()) {
      if (group.controlled())
        groups.append(nb::make_tuple(group.name, group.command_low, group.command_high));
    }
    task_.get().attr("_mjs_bind")(host_->simulation(sim), groups);
    graspable_.clear();
    for (nb::handle body : task_.get().attr("_mjs_graspable")()) {
      const auto full = nb::cast<std::string>(body);
      const int id = scene::resolve(model(), mjOBJ_BODY, full, fmt::format("task '{}'", name_));
      graspable_.push_back({id, last_part(full), tasks::episode::object_shape(model(), id)});
    }
    for (int w = 0; w < num_worlds(); ++w) {
      set_objects(w, task_.get().attr("_mjs_roles")(w));
    }
  });
}

void PythonTask::set_objects(int world, nb::handle roles) {
  std::vector<tasks::episode::TaskObject> found;
  for (auto [role, body] : nb::cast<nb::dict>(roles)) {
    const auto full = nb::cast<std::string>(body);
    const auto name = nb::cast<std::string>(role);
    found.push_back({.role = name,
                     .body = scene::resolve(model(), mjOBJ_BODY, full,
                                            fmt::format("task '{}', object '{}'", name_, name)),
                     .name = last_part(full),
                     .thin = name.find("handle") != std::string::npos});
  }
  std::vector<tasks::episode::TaskObject>& now = objects_[world];
  if (!now.empty() && !std::ranges::equal(now, found, {}, &tasks::episode::TaskObject::role,
                                          &tasks::episode::TaskObject::role)) {
    throw ValueError(
        fmt::format("task '{}': the roles of its objects must be the same, in the same order, "
                    "in every episode",
                    name_));
  }
  now = std::move(found);
  starts_[world].resize(now.size());
  if (now.empty() || graspable_.empty()) return;
  const auto at = std::ranges::find(graspable_, now[0].body, &tasks::episode::GraspObject::body);
  if (at == graspable_.end()) {
    throw ValueError(fmt::format("task '{}': the object '{}' is body '{}', which is not graspable",
                                 name_, now[0].role, now[0].name));
  }
  target_[world] = static_cast<int>(at - graspable_.begin());
}

std::optional<Pose> PythonTask::sample_scene(int world, Rng& rng,
                                             const tasks::robots::StateRow& state) {
  robot().write_joints(state, rng);  // before sample(), which may change them
  return call("sample", [&]() -> std::optional<Pose> {
    nb::object base = task_.get().attr("_mjs_sample")(world, episode(world), cfg().seed);
    set_objects(world, task_.get().attr("_mjs_roles")(world));
    if (base.is_none()) return {};
    return read_pose(base, place("sample"));
  });
}

void PythonTask::begin(const World& world) {
  tasks::episode::Task::begin(world);
  for (std::size_t i = 0; i < objects_[world.id].size(); ++i) {
    const int body = objects_[world.id][i].body;
    starts_[world.id][i] = {vec3(world.data->xpos + 3 * body), quat(world.data->xquat + 4 * body)};
  }
}

void PythonTask::begin_all(tasks::episode::ActiveWorlds& worlds) {
  tasks::episode::Task::begin_all(worlds);
  call("begin", [&] {
    nb::list ids;
    for (int w : worlds.ids()) ids.append(w);
    task_.get().attr("_mjs_begin")(ids);
  });
}

void PythonTask::evaluate_all(tasks::episode::ActiveWorlds& worlds,
                              std::span<tasks::episode::Evaluation> out) {
  call("evaluate", [&] {
    nb::list ids;
    for (int w : worlds.ids()) ids.append(w);
    nb::object found = task_.get().attr("_mjs_evaluate")(ids);
    const auto reward = nb::cast<Doubles>(found[0]);
    const auto success = nb::cast<Bools>(found[1]), over = nb::cast<Bools>(found[2]);
    for (int w : worlds.ids()) {
      out[w] = found_[w] = make_evaluation(w, reward.data()[w], success.data()[w], over.data()[w]);
    }
    read_info(found[3]);
  });
}

void PythonTask::read_info(nb::handle info) {
  if (info.is_none()) return;
  for (auto [key, column] : nb::cast<nb::dict>(info)) {
    const auto values = nb::cast<Values>(column[2]);
    Info& kept = info_[nb::cast<std::string>(key)];
    kept.kind = nb::cast<std::string>(column[0])[0];
    kept.width = nb::cast<std::size_t>(column[1]);
    kept.values.assign(values.data(), values.data() + values.size());
  }
}

void PythonTask::write_info(const World& world, JsonWriter& json) const {
  const auto number = [&](char kind, double x) {
    if (kind == 'b') return json.value(x != 0), void();
    if (kind == 'i') return json.value(static_cast<std::int64_t>(x)), void();
    json.value(x);
  };
  const auto own = [&](const char* key) {
    json.key(key);
    if (key[0] == 'e') json.value(episode_step(world.id));
    if (key[0] == 's') json.value(found_[world.id].success);
  };
  const char* const ours[] = {"episode_step", "success"};
  std::size_t next = 0;
  for (const auto& [key, info] : info_) {
    while (next < 2 && ours[next] < key) own(ours[next++]);
    if (next < 2 && key == ours[next]) ++next;  // values of the task have priority
    json.key(key);
    const std::size_t n = std::max<std::size_t>(info.width, 1);
    const double* values = info.values.data() + world.id * n;
    if (info.width == 0) {
      number(info.kind, values[0]);
      continue;
    }
    json.begin_array();
    for (std::size_t i = 0; i < n; ++i) number(info.kind, values[i]);
    json.end_array();
  }
  while (next < 2) own(ours[next++]);
}

std::string PythonTask::description(int world) const {
  return call("description",
              [&] { return nb::cast<std::string>(task_.get().attr("_mjs_description")(world)); });
}

tasks::episode::Task::Referrals PythonTask::referrals(int world) const {
  return call("referrals", [&] {
    Referrals all;
    for (auto [role, texts] : nb::cast<nb::dict>(task_.get().attr("_mjs_referrals")(world))) {
      std::vector<tasks::episode::Referral> list;
      for (nb::handle text : texts)
        list.push_back({nb::cast<std::string>(text[0]), nb::cast<double>(text[1])});
      all.emplace_back(nb::cast<std::string>(role), std::move(list));
    }
    return all;
  });
}

std::vector<std::pair<std::string, std::string>> PythonTask::scene_info(int world) const {
  return call("scene_info", [&] {
    std::vector<std::pair<std::string, std::string>> all;
    for (auto [key, text] : nb::cast<nb::dict>(task_.get().attr("_mjs_scene_info")(world)))
      all.emplace_back(nb::cast<std::string>(key), nb::cast<std::string>(text));
    return all;
  });
}

std::size_t PythonTask::role_index(std::string_view role) const {
  std::vector<std::string> roles;
  for (const tasks::episode::TaskObject& object : objects_[0]) {
    if (object.role == role) return roles.size();
    roles.push_back(object.role);
  }
  throw_unknown(fmt::format("task '{}'", name_), "role", role, roles);
}

Pose PythonTask::start_pose(int world, std::string_view role) const {
  return starts_[world][role_index(role)];
}

std::optional<Pose> PythonTask::goal_pose(int /*world*/, std::string_view role) const {
  role_index(role);
  return {};
}

std::vector<std::shared_ptr<Sensor>> PythonTask::create_task_sensors() const {
  std::vector<std::shared_ptr<Sensor>> sensors;
  if (!objects_[0].empty()) {
    sensors.push_back(tasks::episode::start_pose_sensor(*this, "obj_start", objects_[0][0].role));
  }
  for (const tasks::episode::TaskObject& object : objects_[0]) {
    if (auto held = tasks::episode::grasp_state_sensor(*this, object.role))
      sensors.push_back(std::move(held));
  }
  call("sensors", [&] {
    for (auto& own : host_->members(task_.get().attr("_mjs_sensors")(), simulation_.lock()))
      sensors.push_back(std::move(own));
  });
  return sensors;
}

void PythonTask::edit_suite(observe::SensorSuite& suite) const {
  call("suite", [&] {
    nb::object wanted = task_.get().attr("_mjs_suite")(suite.names());
    if (!wanted.is_none()) suite.select(nb::cast<std::vector<std::string>>(wanted));
  });
}

}  // namespace mjsense::python
