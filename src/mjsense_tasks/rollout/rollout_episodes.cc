// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense_tasks/cameras/frozen_cameras.h"
#include "mjsense_tasks/policies/planner/start_reach.h"
#include "mjsense_tasks/rollout/action_sensors.h"
#include "mjsense_tasks/rollout/episode_cameras.h"
#include "mjsense_tasks/rollout/replay_sensor.h"
#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense::tasks::rollout {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kDraws = 10;  // maximum draws of a start until one is playable
// Further draws are accepted even if the robot does not reach the target: there may be no other.
constexpr int kReachDraws = 6;

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::span<double> state_row(sim::Simulation& simulation, int world) {
  const ArrayView rows = simulation.worlds().state();
  return {reinterpret_cast<double*>(rows.data + world * rows.strides[0]),
          static_cast<std::size_t>(rows.shape[1])};
}

std::vector<double> state_of(sim::Simulation& simulation, int world) {
  const std::span<const double> row = state_row(simulation, world);
  return {row.begin(), row.end()};
}

}  // namespace

// Runs a function on the fresh data of some worlds, in parallel.
class Rollout::ForEachHook final : public worlds::WorldHooks {
 public:
  explicit ForEachHook(std::function<void(const World&)> body) : body_(std::move(body)) {}
  void substep(const World& /*world*/) override {}
  void reset(const World& /*world*/) override {}
  void refreshed(const World& world) override { body_(world); }

 private:
  std::function<void(const World&)> body_;
};

// A subset of the worlds, as seen by tasks and policies.
class Rollout::WorldSubset final : public episode::ActiveWorlds {
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
    actions_[w] = robots::Action{};
    log_->begin(w);
    depth_->begin(w);
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

// Samples the starts and makes them fresh. Starts that cannot be played are drawn again, as are those
// in which the robot does not reach the target; those that still cannot be played after kDraws draws
// become faults.
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
    for_each(left, [&](const World& world) {
      why[world.id] = task_->start_error(world);
      if (task_->given_start(world.id)) return;
      if (why[world.id].empty() && reach_ && draw < kReachDraws && !(*reach_)(world))
        why[world.id] = "the robot does not reach the target";
    });
    std::erase_if(left, [&](int w) {
      if (!why[w].empty() && task_->given_start(w)) set_fault(w, why[w]);
      return why[w].empty() || !faults_[w].empty();
    });
  }
  for (int w : left) set_fault(w, std::move(why[w]));
}

// Computes the poses of cameras that vary between episodes.
void Rollout::place_cameras(std::span<const int> worlds) {
  if (!camera_system_->varies() && !(view_ && view_->varies())) return;
  std::vector<std::string> why(num_worlds());
  for_each(worlds, [&](const World& world) {
    if (!faults_[world.id].empty()) return;
    std::vector<int> objects;
    for (const episode::TaskObject& object : task_->objects(world.id)) {
      if (object.body >= 0) objects.push_back(object.body);
    }
    const auto number = static_cast<std::uint64_t>(episode(world.id));
    const Vec3 centre = middle_of(*task_, world);
    why[world.id] = camera_system_->place_cameras(world, cfg_.seed, number, centre, objects);
    if (!view_ || !view_->varies()) return;
    const robots::Robot& robot = task_->robot();
    std::vector<int> parts{robot.base_body()};
    for (const robots::MoveGroup& group : robot.groups()) {
      if (group.kind == robots::GroupKind::kGripper) parts.push_back(group.root_body);
    }
    objects.insert(objects.end(), parts.begin(), parts.end());
    if (view_->place_cameras(world, cfg_.seed, number, centre, objects).empty()) return;
    // Targets of navigation may be behind walls.
    view_->place_cameras(world, cfg_.seed, number, robot.base_pose(world).p, parts);
  });
  for (int w : worlds) {
    const episode::GivenStart* given = task_->given_start(w);
    if (given && !given->cameras.empty())
      camera_system_->set_poses(
          w, cameras::read_frozen(given->cameras, robots::Robot::kPrefix, "starts"));
    if (!why[w].empty()) set_fault(w, std::move(why[w]));
  }
  simulation_->worlds().model_changed();
  simulation_->forward(worlds);
  take_failures();
}

void Rollout::act() {
  if (!policy_) throw ValueError("this rollout has no policy: write action(world) before step()");
  const auto begun = Clock::now();
  for (int w : active_worlds()) actions_[w] = robots::Action{};
  if (!ids_.empty()) {
    WorldSubset worlds(*this, ids_);
    policy_->act_all(worlds, actions_);
  }
  times_.policy += since(begun);
}

// Applies the actions of these worlds and advances them. `answers`: the actions answer the current
// observation (false for the later steps of a chunk). `recorded`: steps that replace what was
// written.
void Rollout::move(std::span<const int> worlds, bool answers,
                   std::span<const RecordedStep> recorded) {
  auto begun = Clock::now();
  std::vector<std::vector<double>> before;
  for (const RecordedStep& step : recorded) before.push_back(state_of(*simulation_, step.world));
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
  for (std::size_t k = 0; k < recorded.size(); ++k) write_recorded(recorded[k], before[k]);
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

void Rollout::write_recorded(const RecordedStep& step, std::span<const double> before) {
  const std::span<double> row = state_row(*simulation_, step.world);
  for (std::size_t i = 0; i < row.size(); ++i)
    row[i] = std::isnan(step.written[i]) ? before[i] : step.written[i];
  replay_->play(step.world, step.ctrl, step.mocap);
}

void Rollout::repeat(std::span<const RecordedStep> steps) {
  if (!replay_) throw ValueError("repeat: this rollout has no replay sensor");
  moving_.clear();
  for (const RecordedStep& step : steps) {
    if (active_[step.world] && faults_[step.world].empty()) moving_.push_back(step.world);
  }
  std::ranges::sort(moving_);
  std::vector<RecordedStep> recorded(steps.begin(), steps.end());
  std::erase_if(recorded, [this](const RecordedStep& step) {
    return std::ranges::find(moving_, step.world) == moving_.end();
  });
  if (recorded.empty()) return;
  move(moving_, true, recorded);
  for (const RecordedStep& step : recorded) replay_->play(step.world, {}, {});
  sense();
  std::erase_if(moving_, [this](int w) { return !faults_[w].empty(); });
  evaluate(moving_);
  finish_rows();
}

void Rollout::step() {
  if (active_worlds().empty()) return;
  move(ids_, true);
  sense();
  evaluate(ids_);
  finish_rows();
}

void Rollout::step_chunk(std::span<const robots::Action> actions, bool stop_on_success) {
  const auto B = static_cast<std::size_t>(num_worlds());
  if (actions.empty() || actions.size() % B != 0) {
    throw ValueError(fmt::format(
        "step_chunk: {} actions: must be a positive multiple of the {} worlds", actions.size(), B));
  }
  const std::size_t steps = actions.size() / B;
  std::vector<double> reward(B);
  const auto goes_on = [&](int w) {
    const episode::Evaluation& now = evaluations_[w];
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

void Rollout::sense() {
  const auto begun = Clock::now();
  const double cast = cast_cost();
  repeat_until_complete([this] { suite_.refresh(ids_); });
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
  refuse_deep_contacts(worlds);
  for (int w : worlds) {
    const double reward = evaluations_[w].reward;
    if (!std::isfinite(reward))
      set_fault(w, fmt::format("task '{}': the reward is {}", task_->name(), reward));
  }
  times_.sensing += since(begun);
}

void Rollout::refuse_deep_contacts(std::span<const int> worlds) {
  if (!depth_->has_limit()) return;
  for_each(worlds, [this](const World& world) { depth_->observe(world); });
  for (int w : worlds) {
    if (!evaluations_[w].success || !depth_->is_exceeded(w)) continue;
    evaluations_[w].success = false;
    evaluations_[w].missing = kTooDeep;
  }
}

// Updates rows that depend on the evaluation, which happens after the sensors.
void Rollout::finish_rows() {
  for (int w : ids_) {
    if (evaluations_[w].terminal) blank_actions(suite_, w, !(*log_)[w].given);
  }
  Sensor* info = task_->info_follows_evaluation() ? suite_.find("task_info") : nullptr;
  if (!info) return;
  repeat_until_complete(
      [this, info] { for_each(ids_, [info](const World& world) { info->compute(world); }); });
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

}  // namespace mjsense::tasks::rollout
