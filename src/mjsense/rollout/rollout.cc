// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rollout/rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>

#include "mjsense/core/error.h"
#include "mjsense/core/row_error.h"
#include "mjsense/observe/shared_field.h"
#include "mjsense/rollout/action_sensors.h"
#include "mjsense/rollout/episode_cameras.h"
#include "mjsense/rollout/replay_sensor.h"
#include "mjsense/rollout/task_defaults.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"

namespace mjsense {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kDraws = 10;  // maximum draws of a start until one is playable
// m/s or rad/s. MuJoCo's own limit is 1e10, which lets an object that a contact has thrown away fly
// on until the horizon.
constexpr double kMaxSpeed = 1e4;

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

TaskCfg task_cfg(const RolloutCfg& cfg) {
  TaskCfg out;
  if (!cfg.robot.empty()) {
    out.robot = robot_cfg(cfg.robot);
    out.policy_dt_ms = out.robot.policy_dt_ms;
    out.ctrl_dt_ms = out.robot.ctrl_dt_ms;
    out.sim_dt_ms = out.robot.sim_dt_ms;
  }
  if (!out.robot.python_sensors.empty() && !cfg.robot_sensors) {
    const PythonSensorRef& sensor = out.robot.python_sensors.front();
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
  out.terminate_upon_success = cfg.terminate_upon_success;
  if (!cfg.make_task) set_task_defaults(cfg.task, out);
  if (cfg.horizon) out.horizon = *cfg.horizon;
  return out;
}

// Removes the task's sensors whose names are used by `others`: a user-composed suite may replace
// them.
void drop_of_task(SensorSuite& suite, std::span<const std::shared_ptr<Sensor>> others) {
  std::vector<std::string> kept;
  for (const std::string& name : suite.names()) {
    const bool replaced = suite.owner(name).starts_with("task ") &&
                          std::ranges::any_of(others, [&](auto& o) { return o->name() == name; });
    if (!replaced) kept.push_back(name);
  }
  suite.select(kept);
}

}  // namespace

RolloutCfg resolved(RolloutCfg cfg) {
  // A user-defined task may have its robot in its scene.
  if (cfg.robot == kTaskRobot) cfg.robot = cfg.make_task ? "" : default_robot(cfg.task);
  if (cfg.scene.empty() && !cfg.make_scene && !cfg.make_task)
    cfg.scene = default_scene(task_components(cfg.task)[0]);
  return cfg;
}

// Runs a function on the fresh data of some worlds, in parallel.
class Rollout::ForEachHook final : public WorldHooks {
 public:
  explicit ForEachHook(std::function<void(const World&)> body) : body_(std::move(body)) {}
  void substep(const World& /*world*/) override {}
  void reset(const World& /*world*/) override {}
  void refreshed(const World& world) override { body_(world); }

 private:
  std::function<void(const World&)> body_;
};

// A subset of the worlds, as seen by tasks and policies.
class Rollout::WorldSubset final : public ActiveWorlds {
 public:
  WorldSubset(Rollout& rollout, std::span<const int> ids) : rollout_(rollout), ids_(ids) {}
  std::span<const int> ids() const override { return ids_; }
  void for_each(std::function<void(const World&)> body) override {
    rollout_.for_each(ids_, std::move(body));
  }

 private:
  Rollout& rollout_;
  std::span<const int> ids_;
};

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

Rollout::Rollout(RolloutCfg cfg, std::shared_ptr<Task> task, std::shared_ptr<Policy> policy)
    : cfg_(std::move(cfg)), policy_(std::move(policy)), task_(std::move(task)) {
  const TaskCfg& own = task_->cfg();
  cfg_.task = task_->name();
  cfg_.robot = own.robot.name;
  cfg_.scene = own.scene;
  cfg_.policy = policy_ ? policy_->name() : "";
  cfg_.seed = own.seed;
  cfg_.horizon = own.horizon;
  cfg_.action_noise = own.action_noise;
  cfg_.perturb = own.perturb;
  cfg_.terminate_upon_success = own.terminate_upon_success;
  check_fields(cfg_, "");
  make();
}

void Rollout::make() {
  if (cfg_.on_construct_begin) cfg_.on_construct_begin(*this);
  camera_system_ = std::make_unique<CameraSystem>(choose_cameras(*task_, cfg_));
  cameras_ = recorded_cameras(*camera_system_);
  SceneCfg scene_cfg = task_->scene_cfg_with_robot();
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    scene_cfg.sensors.push_back(std::make_shared<CameraSensorCfg>(
        camera_sensor_cfg(*camera_system_, static_cast<int>(i), cameras_[i], cfg_)));
  }
  if (cfg_.default_view)
    scene_cfg.sensors.push_back(std::make_shared<CameraSensorCfg>(default_view(*task_, cfg_)));
  auto scene = std::make_shared<Scene>(std::move(scene_cfg));
  simulation_ = std::make_shared<Simulation>(scene, SimulationCfg{.num_worlds = cfg_.num_worlds,
                                                                  .decimation = task_->decimation(),
                                                                  .threads = cfg_.threads,
                                                                  .seed = cfg_.seed});
  simulation_->measure_cost(true);
  for (RecordedCamera& camera : cameras_) camera.sensor = &scene->sensor(camera.name);
  camera_system_->initialize(*simulation_);
  task_->bind(simulation_);
  if (policy_) policy_->bind(simulation_);
  task_->initialize(scene->model(), cfg_.num_worlds);
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
      if (replay_) replay_->note_tick(world, index);
      return valid;
    });
  }
  if (policy_) task_->register_policy(*policy_);
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

  actions_.resize(cfg_.num_worlds);
  evaluations_.resize(cfg_.num_worlds);
  faults_.resize(cfg_.num_worlds);
  active_.assign(cfg_.num_worlds, 0);
  refused_.assign(cfg_.num_worlds, 0);
  for (int w = 0; w < cfg_.num_worlds; ++w) rows_.push_back(state_row(simulation_->worlds(), w));
  ids_.reserve(cfg_.num_worlds);
  moving_.reserve(cfg_.num_worlds);
  if (cfg_.on_constructed) cfg_.on_constructed(*this);
}

// The sensors of the robot's file, then those created in Python.
std::vector<std::shared_ptr<Sensor>> Rollout::robot_sensors() {
  std::vector<std::shared_ptr<Sensor>> sensors;
  for (const auto& cfg : task_->cfg().robot.sensors) {
    sensors.push_back(
        std::make_shared<SharedSensor>(cfg->name, simulation_->scene().sensor(cfg->key())));
  }
  if (cfg_.robot_sensors) {
    for (auto& sensor : cfg_.robot_sensors(*this)) sensors.push_back(std::move(sensor));
  }
  return sensors;
}

Rollout::~Rollout() = default;

const Sensor* Rollout::replay_sensor() const { return replay_.get(); }

std::span<const int> Rollout::active_worlds() {
  ids_.clear();
  for (int w = 0; w < num_worlds(); ++w) {
    if (active_[w] && faults_[w].empty()) ids_.push_back(w);
  }
  return ids_;
}

void Rollout::for_each(std::span<const int> worlds, std::function<void(const World&)> body) {
  ForEachHook hooks(std::move(body));
  simulation_->worlds().visit(worlds, hooks);
}

void Rollout::set_fault(int world, std::string text) {
  if (!active_[world] || !faults_[world].empty()) return;
  faults_[world] = std::move(text);
  evaluations_[world] = {};  // discard the evaluation of the previous step
}

void Rollout::take_failures() {
  for (const Failure& failure : simulation_->failures()) set_fault(failure.world, failure.message);
}

// Ends the episodes in which something is faster than kMaxSpeed.
void Rollout::check_speeds(std::span<const int> worlds) {
  const mjModel* m = simulation_->model();
  for (int w : worlds) {
    for (int i = 0; i < m->nv; ++i) {
      const double speed = std::abs(rows_[w].qvel[i]);
      if (speed <= kMaxSpeed) continue;
      const int body = m->dof_bodyid[i];
      const char* name = mj_id2name(m, mjOBJ_BODY, body);
      set_fault(w, fmt::format("the physics diverged: body '{}' moves at {:.2g} m/s or rad/s, more "
                               "than {:.0e}",
                               name ? name : std::to_string(body), speed, kMaxSpeed));
      break;
    }
  }
}

void Rollout::reseed(std::uint64_t seed) {
  std::ranges::fill(active_, 0);
  cfg_.seed = seed;
  task_->reseed(seed);
  simulation_->seed(seed);
}

void Rollout::start(std::span<const int> worlds, std::span<const std::int64_t> episodes) {
  if (worlds.size() != episodes.size()) {
    throw ValueError(
        fmt::format("start: {} worlds, but {} episodes", worlds.size(), episodes.size()));
  }
  if (worlds.empty()) return;
  const auto begun = Clock::now();
  const std::vector<int> sorted = simulation_->worlds().checked_ids(worlds);
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    const int w = worlds[k];
    active_[w] = true;
    faults_[w].clear();
    evaluations_[w] = {};
    refused_[w] = false;
    actions_[w] = Action{};
    log_->begin(w);
  }
  sample(worlds, episodes);
  place_cameras(sorted);
  WorldSubset begins(*this, sorted);
  task_->begin_all(begins);
  if (policy_) policy_->reset_all(begins);
  times_.reset += since(begun);
  sense();
  moving_.assign(sorted.begin(), sorted.end());
  std::erase_if(moving_, [this](int w) { return !faults_[w].empty(); });
  evaluate(moving_);
  finish_rows();
}

// Samples the starts and makes them fresh. Starts that cannot be played are drawn again; those that
// still cannot after kDraws draws become faults.
void Rollout::sample(std::span<const int> worlds, std::span<const std::int64_t> episodes) {
  std::vector<std::int64_t> of(num_worlds());
  for (std::size_t k = 0; k < worlds.size(); ++k) of[worlds[k]] = episodes[k];
  std::vector<int> left = simulation_->worlds().checked_ids(worlds);
  std::vector<std::string> why(num_worlds());
  for (int draw = 0; draw < kDraws && !left.empty(); ++draw) {
    for (int w : left) simulation_->worlds().rekey(w, static_cast<std::uint32_t>(of[w]));
    simulation_->reset(left, task_->start_key());
    for (int w : left) task_->sample(w, of[w], rows_[w], draw);
    simulation_->forward(left);
    take_failures();
    for_each(left, [&](const World& world) { why[world.id] = task_->start_error(world); });
    std::erase_if(left, [&](int w) { return why[w].empty() || !faults_[w].empty(); });
  }
  for (int w : left) set_fault(w, std::move(why[w]));
}

// Computes the poses of cameras that vary between episodes.
void Rollout::place_cameras(std::span<const int> worlds) {
  if (!camera_system_->varies()) return;
  std::vector<std::string> why(num_worlds());
  for_each(worlds, [&](const World& world) {
    if (!faults_[world.id].empty()) return;
    std::vector<int> objects;
    for (const TaskObject& object : task_->objects(world.id)) {
      if (object.body >= 0) objects.push_back(object.body);
    }
    why[world.id] = camera_system_->place_cameras(world, cfg_.seed,
                                                  static_cast<std::uint64_t>(episode(world.id)),
                                                  middle_of(*task_, world), objects);
  });
  for (int w : worlds) {
    if (!why[w].empty()) set_fault(w, std::move(why[w]));
  }
  simulation_->worlds().model_changed();
  simulation_->forward(worlds);
  take_failures();
}

std::string Rollout::obs_scene(int world) const {
  std::string scene = task_->obs_scene(world);
  if (cfg_.camera_system.empty() && !camera_system_->varies()) return scene;
  return fmt::format("{},\"cameras\":{}}}", scene.substr(0, scene.rfind('}')),
                     camera_system_->frozen(world));
}

void Rollout::act() {
  if (!policy_) throw ValueError("this rollout has no policy: write action(world) before step()");
  const auto begun = Clock::now();
  for (int w : active_worlds()) actions_[w] = Action{};
  if (!ids_.empty()) {
    WorldSubset worlds(*this, ids_);
    policy_->act_all(worlds, actions_);
  }
  times_.policy += since(begun);
}

// Applies the actions of these worlds and advances them. `answers`: the actions answer the current
// observation (false for the later steps of a chunk).
void Rollout::move(std::span<const int> worlds, bool answers) {
  auto begun = Clock::now();
  if (answers) {
    for_each(worlds, [this](const World& world) {
      log_->remember(world, task_->robot());
      task_->apply(world, actions_[world.id], rows_[world.id]);
    });
  } else {
    for_each(worlds, [this](const World& world) {
      task_->apply(world, actions_[world.id], rows_[world.id]);
    });
  }
  task_->advance();
  if (replay_) replay_->note_written(worlds);
  times_.policy += since(begun);

  begun = Clock::now();
  const double rows = row_cost(), cast = cast_cost();
  guard_rows([this, &worlds] { simulation_->step(1, worlds); });
  take_failures();
  check_speeds(worlds);
  const double spent_rows = (row_cost() - rows) / threads();
  const double spent_cast = cast_cost() - cast;
  times_.sensing += spent_rows;
  times_.rendering += spent_cast;
  times_.physics += since(begun) - spent_rows - spent_cast;
}

void Rollout::step() {
  if (active_worlds().empty()) return;
  move(ids_, true);
  sense();
  evaluate(ids_);
  finish_rows();
}

void Rollout::step_chunk(std::span<const Action> actions, bool stop_on_success) {
  const auto B = static_cast<std::size_t>(num_worlds());
  if (actions.empty() || actions.size() % B != 0) {
    throw ValueError(fmt::format(
        "step_chunk: {} actions: must be a positive multiple of the {} worlds", actions.size(), B));
  }
  const std::size_t steps = actions.size() / B;
  std::vector<double> reward(B);
  const auto goes_on = [&](int w) {
    const Evaluation& now = evaluations_[w];
    return active_[w] && faults_[w].empty() && !now.terminal && !now.truncated &&
           !(stop_on_success && now.success);
  };
  moving_.assign(active_worlds().begin(), active_worlds().end());
  for (std::size_t k = 0; k < steps && !moving_.empty(); ++k) {
    for (int w : moving_) actions_[w] = actions[k * B + w];
    move(moving_, k == 0);
    std::erase_if(moving_, [&](int w) { return !faults_[w].empty(); });
    if (moving_.empty()) break;
    evaluate(moving_);
    for (int w : moving_) reward[w] += evaluations_[w].reward;
    std::erase_if(moving_, [&](int w) { return !goes_on(w); });
  }
  for (int w : active_worlds()) evaluations_[w].reward = reward[w];
  sense();
  finish_rows();
}

// Runs `body`. If a row cannot be computed, only the episode of its world ends, and the result is
// false.
bool Rollout::guard_rows(const std::function<void()>& body) {
  try {
    body();
    return true;
  } catch (const RowError& e) {
    for (const RowError::Fault& fault : e.faults) {
      if (!active_[fault.world] || !faults_[fault.world].empty()) throw;
    }
    for (const RowError::Fault& fault : e.faults) {
      set_fault(fault.world, fault.text);
      refused_[fault.world] = true;
    }
    return false;
  }
}

void Rollout::sense() {
  const auto begun = Clock::now();
  const double cast = cast_cost();
  while (!active_worlds().empty() && !guard_rows([this] { suite_.refresh(ids_); })) {
  }
  if (replay_) {
    Sensor* const replay[] = {replay_.get()};
    simulation_->refresh(replay, active_worlds());
  }
  const double spent_cast = cast_cost() - cast;
  times_.rendering += spent_cast;
  times_.sensing += since(begun) - spent_cast;
}

// Evaluates each world exactly once per observation, because a task may keep state between
// evaluations.
void Rollout::evaluate(std::span<const int> worlds) {
  if (worlds.empty()) return;
  const auto begun = Clock::now();
  WorldSubset some(*this, worlds);
  task_->evaluate_all(some, evaluations_);
  for (int w : worlds) {
    const double reward = evaluations_[w].reward;
    if (!std::isfinite(reward))
      set_fault(w, fmt::format("task '{}': the reward is {}", task_->name(), reward));
  }
  times_.sensing += since(begun);
}

// Updates rows that depend on the evaluation, which happens after the sensors.
void Rollout::finish_rows() {
  for (int w : ids_) {
    if (evaluations_[w].terminal) blank_actions(suite_, w, !(*log_)[w].given);
  }
  Sensor* info = task_->info_follows_evaluation() ? suite_.find("task_info") : nullptr;
  if (!info) return;
  while (!active_worlds().empty() && !guard_rows([this, info] {
    for_each(ids_, [info](const World& world) { info->compute(world); });
  })) {
  }
}

double Rollout::row_cost() const {
  double seconds = simulation_->ray_scene_cost();
  for (const auto& sensor : suite_.sensors()) seconds += simulation_->cost(*sensor).compute;
  for (const RecordedCamera& camera : cameras_) {
    seconds += simulation_->cost(*camera.sensor).compute;
  }
  return seconds;
}

double Rollout::cast_cost() const {
  double seconds = 0;
  for (const RecordedCamera& camera : cameras_) seconds += simulation_->cost(*camera.sensor).cast;
  return seconds;
}

// Number of threads that share the sensor work of one step.
int Rollout::threads() const {
  return std::max(1, std::min<int>(simulation_->worlds().threads(), static_cast<int>(ids_.size())));
}

}  // namespace mjsense
