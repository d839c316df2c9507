// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <nlohmann/json.hpp>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/observe/shared_field.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"
#include "mjsense_tasks/policies/planner/start_reach.h"
#include "mjsense_tasks/rollout/episode_cameras.h"
#include "mjsense_tasks/rollout/replay_sensor.h"
#include "mjsense_tasks/rollout/task_defaults.h"
#include "mjsense_tasks/scenes/scene_split.h"

namespace mjsense::tasks::rollout {
namespace {

void set_arm_controller(const std::string& text, robots::RobotCfg& robot) {
  const robots::ControllerCfg controller = robots::parse_controller(text, "arm_controller");
  bool any = false;
  for (robots::MoveGroupCfg& group : robot.groups) {
    if (group.kind != robots::GroupKind::kArm) continue;
    group.controller = controller;
    any = true;
  }
  if (!any)
    throw ValueError(
        fmt::format("arm_controller is '{}', but robot '{}' has no arm", text, robot.name));
}

episode::TaskCfg task_cfg(const RolloutCfg& cfg) {
  episode::TaskCfg out;
  if (!cfg.robot.empty()) {
    out.robot = robots::robot_cfg(cfg.robot);
    if (!cfg.arm_controller.empty()) set_arm_controller(cfg.arm_controller, out.robot);
    out.policy_dt_ms = out.robot.policy_dt_ms;
    out.ctrl_dt_ms = out.robot.ctrl_dt_ms;
    out.sim_dt_ms = out.robot.sim_dt_ms;
  }
  if (!out.robot.python_sensors.empty() && !cfg.robot_sensors) {
    const robots::PythonSensorRef& sensor = out.robot.python_sensors.front();
    throw ValueError(
        fmt::format("robot '{}': sensor '{}' is the Python class '{}', which this program cannot "
                    "run: call mjsense.record() or mjsense.make_vec() from Python",
                    cfg.robot, sensor.name, sensor.class_name));
  }
  out.scene = cfg.scene;
  out.make_scene = cfg.make_scene;
  if (cfg.meshes == "shapes") out.robot.edit_spec = {};
  if (cfg.meshes == "real" && !out.robot.edit_spec) {
    throw ValueError(
        fmt::format("robot '{}': its real meshes were not found: set meshes to shapes or auto, or "
                    "name their folder in the robot's environment variable (see the robot's page)",
                    cfg.robot));
  }
  out.seed = cfg.seed;
  out.action_noise = cfg.action_noise;
  out.perturb = cfg.perturb;
  out.instructions = cfg.instructions;
  out.terminate_upon_success = cfg.terminate_upon_success;
  if (!cfg.starts.empty()) out.starts = episode::read_starts(cfg.starts);
  if (!cfg.make_task) set_task_defaults(cfg.task, out);
  if (cfg.horizon) out.horizon = *cfg.horizon;
  if (cfg.policy_dt_ms) out.policy_dt_ms = *cfg.policy_dt_ms;
  return out;
}

// Removes the task's sensors whose names are used by `others`: a user-composed suite may replace
// them.
void drop_of_task(observe::SensorSuite& suite, std::span<const std::shared_ptr<Sensor>> others) {
  std::vector<std::string> kept;
  for (const std::string& name : suite.names()) {
    const bool replaced = suite.owner(name).starts_with("task ") &&
                          std::ranges::any_of(others, [&](auto& o) { return o->name() == name; });
    if (!replaced) kept.push_back(name);
  }
  suite.select(kept);
}

}  // namespace

constexpr double kMaxPenetration = 0.004;  // m

RolloutCfg resolved(RolloutCfg cfg) {
  // A user-defined task may have its robot in its scene.
  if (cfg.robot == kTaskRobot) cfg.robot = cfg.make_task ? "" : default_robot(cfg.task);
  if (cfg.scene.empty() && !cfg.make_scene && !cfg.make_task)
    cfg.scene = default_scene(task_components(cfg.task)[0]);
  // A user-defined task may press objects into soft ground on purpose.
  if (!cfg.max_penetration) cfg.max_penetration = cfg.make_task ? 0 : kMaxPenetration;
  if (!cfg.split.empty()) {
    check_fields(cfg, "");
    if (cfg.make_scene || cfg.scene.empty())
      throw ValueError(fmt::format(
          "split is '{}', but {}; only scenes with a name or a file have splits", cfg.split,
          cfg.make_scene ? "the scene is an object" : "the task has no named scene"));
    cfg.scene = scenes::name_of_split(cfg.scene, std::exchange(cfg.split, ""));
  }
  return cfg;
}

Rollout::Rollout(const RolloutCfg& cfg) : cfg_(resolved(cfg)) {
  check_fields(cfg_, "");
  task_ = cfg_.make_task ? cfg_.make_task(task_cfg(cfg_)) : make_task(cfg_.task, task_cfg(cfg_));
  if (cfg_.make_policy) {
    policy_ = cfg_.make_policy();
  } else if (!cfg_.policy.empty()) {
    policy_ = make_policy(cfg_.policy);
  }
  make();
}

Rollout::Rollout(RolloutCfg cfg, std::shared_ptr<episode::Task> task,
                 std::shared_ptr<episode::Policy> policy)
    : cfg_(std::move(cfg)), policy_(std::move(policy)), task_(std::move(task)) {
  const episode::TaskCfg& own = task_->cfg();
  cfg_.task = task_->name();
  cfg_.robot = own.robot.name;
  cfg_.scene = own.scene;
  cfg_.policy = policy_ ? policy_->name() : "";
  cfg_.seed = own.seed;
  cfg_.horizon = own.horizon;
  cfg_.policy_dt_ms = own.policy_dt_ms;
  cfg_.action_noise = own.action_noise;
  cfg_.perturb = own.perturb;
  cfg_.instructions = own.instructions;
  cfg_.terminate_upon_success = own.terminate_upon_success;
  if (!cfg_.max_penetration) cfg_.max_penetration = 0;
  check_fields(cfg_, "");
  make();
}

void Rollout::make() {
  if (cfg_.on_construct_begin) cfg_.on_construct_begin(*this);
  make_simulation();
  bind_task();
  control_robot();
  if (policy_) task_->register_policy(*policy_);
  reach_ = policies::StartReach::make(*task_);
  compose_suite();
  resize_worlds();
  if (cfg_.on_constructed) cfg_.on_constructed(*this);
}

// Compiles the task's scene with the cameras and creates its worlds.
void Rollout::make_simulation() {
  camera_system_ = std::make_unique<cameras::CameraSystem>(choose_cameras(*task_, cfg_));
  cameras_ = recorded_cameras(*camera_system_);
  scene::SceneCfg scene_cfg = task_->scene_cfg_with_robot();
  if (!cfg_.backdrop.empty()) scene_cfg.backdrop = cfg_.backdrop;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    scene_cfg.sensors.push_back(std::make_shared<sensors::CameraSensorCfg>(
        camera_sensor_cfg(*camera_system_, static_cast<int>(i), cameras_[i], cfg_)));
  }
  if (cfg_.default_view) {
    view_ = std::make_unique<cameras::CameraSystem>(default_view(*task_, cfg_));
    scene_cfg.sensors.push_back(std::make_shared<sensors::CameraSensorCfg>(
        camera_sensor_cfg(*view_, 0, recorded_cameras(*view_)[0], cfg_)));
  }
  auto scene = std::make_shared<scene::Scene>(std::move(scene_cfg));
  simulation_ =
      std::make_shared<sim::Simulation>(scene, sim::SimulationCfg{.num_worlds = cfg_.num_worlds,
                                                                  .decimation = task_->decimation(),
                                                                  .threads = cfg_.threads,
                                                                  .seed = cfg_.seed});
  simulation_->measure_cost(true);
  for (RecordedCamera& camera : cameras_) camera.sensor = &scene->sensor(camera.name);
}

// Resolves the names of the cameras, the task and the policy in the compiled model.
void Rollout::bind_task() {
  if (!task_->cfg().starts.empty()) camera_system_->allow_poses();
  camera_system_->initialize(*simulation_);
  if (view_) view_->initialize(*simulation_);
  task_->bind(simulation_);
  if (policy_) policy_->bind(simulation_);
  task_->initialize(simulation_->scene().model(), cfg_.num_worlds);
}

// Lets the robot's controllers run within a policy step, and records what a replay needs.
void Rollout::control_robot() {
  const bool controls = task_->robot().controls_every_step();
  if (cfg_.replay_sensor) {
    const int every = controls ? task_->control_decimation() : task_->decimation();
    replay_ = std::make_shared<ReplaySensor>(simulation_->worlds(),
                                             (task_->decimation() + every - 1) / every);
    simulation_->add(replay_);
  }
  if (controls) {
    simulation_->set_control(task_->control_decimation(), [this](const World& world, int index) {
      const mjtStage valid = index == 0 ? mjSTAGE_ACC : task_->robot().control(world, index);
      return replay_ && replay_->note_tick(world, index) ? mjSTAGE_NONE : valid;
    });
  }
}

void Rollout::compose_suite() {
  log_ = std::make_unique<ActionLog>(cfg_.num_worlds);
  if (cfg_.use_sensors) suite_ = core_suite(*task_, *log_, cameras_, robot_sensors());
  if (cfg_.more_sensors) {
    const auto sensors = cfg_.more_sensors(*this);
    if (cfg_.edit_suite) drop_of_task(suite_, sensors);
    suite_.extend(sensors, "the caller");
  }
  if (cfg_.use_sensors) task_->edit_suite(suite_);
  if (cfg_.edit_suite) cfg_.edit_suite(suite_);
  suite_.bind(*simulation_);
}

void Rollout::resize_worlds() {
  actions_.resize(cfg_.num_worlds);
  evaluations_.resize(cfg_.num_worlds);
  faults_.resize(cfg_.num_worlds);
  active_.assign(cfg_.num_worlds, 0);
  refused_.assign(cfg_.num_worlds, 0);
  depth_.emplace(*cfg_.max_penetration, cfg_.num_worlds);
  for (int w = 0; w < cfg_.num_worlds; ++w)
    rows_.push_back(robots::state_row(simulation_->worlds(), w));
  ids_.reserve(cfg_.num_worlds);
  moving_.reserve(cfg_.num_worlds);
}

// The sensors of the robot's file, then those created in Python.
std::vector<std::shared_ptr<Sensor>> Rollout::robot_sensors() {
  std::vector<std::shared_ptr<Sensor>> sensors;
  for (const auto& cfg : task_->cfg().robot.sensors) {
    sensors.push_back(
        std::make_shared<observe::SharedField>(cfg->name, simulation_->scene().sensor(cfg->key())));
  }
  if (cfg_.robot_sensors) {
    for (auto& sensor : cfg_.robot_sensors(*this)) sensors.push_back(std::move(sensor));
  }
  return sensors;
}

Rollout::~Rollout() = default;

const Sensor* Rollout::replay_sensor() const { return replay_.get(); }

std::string Rollout::obs_scene(int world) const {
  std::string scene = task_->obs_scene(world);
  if (cfg_.camera_system.empty() && !camera_system_->varies()) return scene;
  return fmt::format("{},\"cameras\":{}}}", scene.substr(0, scene.rfind('}')),
                     camera_system_->frozen(world));
}

std::string Rollout::start_text(int world) {
  nlohmann::ordered_json out;
  const std::array<int, 1> ids{world};
  for_each(ids, [&](const World& at) {
    const mjModel* m = at.model;
    const robots::Robot& robot = task_->robot();
    const auto name = [m](int address) { return std::string(m->names + address); };
    for (int j = 0; j < m->njnt; ++j) {
      const std::string body = name(m->name_bodyadr[m->jnt_bodyid[j]]);
      if (body.starts_with(robot.prefix())) continue;
      const double* q = at.data->qpos + m->jnt_qposadr[j];
      if (m->jnt_type[j] == mjJNT_FREE && !task_->present(world, m->jnt_bodyid[j])) {
        out["absent"].push_back(body);
      } else if (m->jnt_type[j] == mjJNT_FREE) {
        out["bodies"][body] = std::vector<double>(q, q + 7);
      } else if (m->jnt_type[j] != mjJNT_BALL) {
        out["joints"][name(m->name_jntadr[j])] = *q;
      }
    }
    for (const robots::MoveGroup& group : robot.groups()) {
      if (group.kind == robots::GroupKind::kBase) continue;
      for (int address : group.qpos) out["robot"][group.name].push_back(at.data->qpos[address]);
    }
    if (const int base = robot.base_body(); base > 0) {
      const double* p = at.data->xpos + 3 * base;
      const double* q = at.data->xquat + 4 * base;
      out["base"] = {p[0], p[1], p[2], q[0], q[1], q[2], q[3]};
    }
    for (const episode::TaskObject& object : task_->objects(world)) {
      if (object.body >= 0) out["objects"][object.role] = name(m->name_bodyadr[object.body]);
    }
  });
  for (const auto& [key, value] : task_->thresholds())
    out["thresholds"][key] = task_->threshold(world, key, value);
  out["instruction"] = task_->instruction(world);
  if (!cameras_.empty())
    out["cameras"] = nlohmann::ordered_json::parse(camera_system_->frozen(world));
  return out.dump();
}

}  // namespace mjsense::tasks::rollout
