// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rollout/rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>

#include "mjsense/core/error.h"
#include "mjsense/observe/json_sensor.h"
#include "mjsense/rollout/registry.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"

namespace mjsense {
namespace {

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

TaskCfg task_cfg(const RolloutCfg& cfg) {
  TaskCfg out;
  out.robot = robot_cfg(cfg.robot);
  out.seed = cfg.seed;
  out.action_noise = cfg.action_noise;
  if (cfg.horizon) out.horizon = *cfg.horizon;
  return out;
}

std::vector<RecordedCamera> chosen_cameras(const RobotCfg& robot, const RolloutCfg& cfg) {
  std::vector<std::string> names;
  for (const CameraMount& mount : robot.cameras) names.push_back(mount.name);
  std::vector<RecordedCamera> cameras;
  for (const std::string& name : cfg.cameras.value_or(names)) {
    const auto mount = std::ranges::find(robot.cameras, name, &CameraMount::name);
    if (mount == robot.cameras.end()) {
      throw_unknown(fmt::format("robot '{}'", robot.name), "camera", name, names);
    }
    if (std::ranges::find(cameras, name, &RecordedCamera::name) != cameras.end()) {
      throw ValueError(fmt::format("camera '{}' is given twice", name));
    }
    cameras.push_back({.name = name,
                       .mjcf_camera = std::string(Robot::kPrefix) + mount->mjcf_camera,
                       .width = cfg.width.value_or(robot.image_width),
                       .height = cfg.height.value_or(robot.image_height),
                       .depth = cfg.depth || mount->record_depth,
                       .image_points = mount->image_points});
  }
  return cameras;
}

CameraSensorCfg camera_cfg(const RecordedCamera& camera, const RolloutCfg& cfg) {
  CameraSensorCfg out;
  out.name = camera.name;
  out.camera_name = camera.mjcf_camera;
  out.width = camera.width;
  out.height = camera.height;
  out.data_types = {"rgb", "segmentation"};
  if (camera.depth) out.data_types.push_back("depth");
  out.use_shadows = cfg.shadows;
  out.samples = cfg.samples;
  return out;
}

}  // namespace

// Runs a function on the fresh data of some worlds, in parallel.
class Rollout::EachActive final : public WorldHooks {
 public:
  explicit EachActive(std::function<void(const World&)> body) : body_(std::move(body)) {}
  void substep(const World& /*world*/) override {}
  void reset(const World& /*world*/) override {}
  void refreshed(const World& world) override { body_(world); }

 private:
  std::function<void(const World&)> body_;
};

Rollout::Rollout(const RolloutCfg& cfg) : cfg_(cfg) {
  check_fields(cfg, "");
  task_ = make_task(cfg.task, task_cfg(cfg));
  if (!cfg.policy.empty()) policy_ = make_policy(cfg.policy);
  cameras_ = chosen_cameras(task_->cfg().robot, cfg);

  SceneCfg scene_cfg = task_->scene_cfg();
  for (const RecordedCamera& camera : cameras_) {
    scene_cfg.sensors.push_back(std::make_shared<CameraSensorCfg>(camera_cfg(camera, cfg)));
  }
  auto scene = std::make_shared<Scene>(std::move(scene_cfg));
  simulation_ = std::make_shared<Simulation>(scene, SimulationCfg{.num_worlds = cfg.num_worlds,
                                                                  .decimation = task_->decimation(),
                                                                  .threads = cfg.threads,
                                                                  .seed = cfg.seed});
  simulation_->measure_cost(true);
  for (RecordedCamera& camera : cameras_) camera.sensor = &scene->sensor(camera.name);
  task_->initialize(scene->model(), cfg.num_worlds);
  if (policy_) task_->register_policy(*policy_);
  log_ = std::make_unique<ActionLog>(cfg.num_worlds);
  suite_ = core_suite(*task_, *log_, cameras_);
  if (cfg.more_sensors) suite_.extend(cfg.more_sensors(simulation_), "the caller");
  suite_.bind(*simulation_);

  actions_.resize(cfg.num_worlds);
  evaluations_.resize(cfg.num_worlds);
  faults_.resize(cfg.num_worlds);
  active_.assign(cfg.num_worlds, 0);
  refused_.assign(cfg.num_worlds, 0);
  for (int w = 0; w < cfg.num_worlds; ++w) rows_.push_back(state_row(simulation_->worlds(), w));
  ids_.reserve(cfg.num_worlds);
}

Rollout::~Rollout() = default;

std::span<const int> Rollout::active_worlds() {
  ids_.clear();
  for (int w = 0; w < num_worlds(); ++w) {
    if (active_[w] && faults_[w].empty()) ids_.push_back(w);
  }
  return ids_;
}

void Rollout::for_each(std::span<const int> worlds, std::function<void(const World&)> body) {
  EachActive hooks(std::move(body));
  simulation_->worlds().visit(worlds, hooks);
}

void Rollout::set_fault(int world, std::string text) {
  if (active_[world] && faults_[world].empty()) faults_[world] = std::move(text);
}

void Rollout::take_failures() {
  for (const Failure& failure : simulation_->failures()) set_fault(failure.world, failure.message);
}

void Rollout::start(std::span<const int> worlds, std::span<const std::int64_t> episodes) {
  if (worlds.size() != episodes.size()) {
    throw ValueError(
        fmt::format("start: {} worlds for {} episodes", worlds.size(), episodes.size()));
  }
  if (worlds.empty()) return;
  const auto begun = Clock::now();
  const std::vector<int> sorted = simulation_->worlds().checked_ids(worlds);
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    const int w = worlds[k];
    active_[w] = true;
    faults_[w].clear();
    refused_[w] = false;
    actions_[w] = Action{};
    simulation_->worlds().rekey(w, static_cast<std::uint32_t>(episodes[k]));
  }
  simulation_->reset(sorted);
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    task_->sample(worlds[k], episodes[k], rows_[worlds[k]]);
    log_->begin(worlds[k]);
  }
  simulation_->forward(sorted);
  take_failures();
  for_each(sorted, [this](const World& world) {
    task_->begin(world);
    if (policy_) policy_->reset(world);
  });
  times_.reset += since(begun);
  observe();
}

void Rollout::act() {
  if (!policy_) throw ValueError("this rollout has no policy: write action(world) before step()");
  const auto begun = Clock::now();
  for_each(active_worlds(), [this](const World& world) {
    actions_[world.id] = Action{};
    policy_->act(world, actions_[world.id]);
  });
  times_.policy += since(begun);
}

void Rollout::step() {
  if (active_worlds().empty()) return;
  auto begun = Clock::now();
  for_each(ids_, [this](const World& world) {
    log_->remember(world, task_->robot());
    task_->apply(world, actions_[world.id], rows_[world.id]);
  });
  times_.policy += since(begun);

  begun = Clock::now();
  const double rows = row_cost(), cast = cast_cost();
  guard_rows([this] { simulation_->step(1, ids_); });
  take_failures();
  const double spent_rows = (row_cost() - rows) / threads();
  const double spent_cast = cast_cost() - cast;
  times_.sensing += spent_rows;
  times_.rendering += spent_cast;
  times_.physics += since(begun) - spent_rows - spent_cast;
  observe();
}

// A row that does not fit ends the episode of its world alone.
bool Rollout::guard_rows(const std::function<void()>& body) {
  try {
    body();
    return true;
  } catch (const RowTooLong& e) {
    if (!active_[e.world] || !faults_[e.world].empty()) throw;
    set_fault(e.world, e.what());
    refused_[e.world] = true;
    return false;
  }
}

void Rollout::observe() {
  const auto begun = Clock::now();
  const double cast = cast_cost();
  while (!active_worlds().empty() && !guard_rows([this] { suite_.refresh(ids_); })) {
  }
  for_each(ids_, [this](const World& world) { evaluations_[world.id] = task_->evaluate(world); });
  const double spent_cast = cast_cost() - cast;
  times_.rendering += spent_cast;
  times_.sensing += since(begun) - spent_cast;
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

// Threads that share the work on the rows of one step.
int Rollout::threads() const {
  return std::max(1, std::min<int>(simulation_->worlds().threads(), static_cast<int>(ids_.size())));
}

}  // namespace mjsense
