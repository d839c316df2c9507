// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/planners.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <utility>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense_tasks/policies/door/door_planner.h"
#include "mjsense_tasks/policies/navigation/nav_planner.h"
#include "mjsense_tasks/policies/planner/manipulation_planner.h"
#include "mjsense_tasks/policies/planner/opening_planner.h"
#include "mjsense_tasks/policies/planner/pick_planner.h"
#include "mjsense_tasks/rollout/combined_planner.h"
#include "mjsense_tasks/rollout/nav_and_pick_planner.h"

namespace mjsense::tasks::rollout {
namespace {

std::unique_ptr<episode::PlannerPolicy> make_manipulation() {
  return std::make_unique<policies::ManipulationPlanner>();
}

std::unique_ptr<episode::PlannerPolicy> make_nav_and_pick() {
  return std::make_unique<NavAndPickPlanner>();
}

struct Planners {
  std::mutex mutex;
  // Built-in task types first, then registered ones in the order of registration.
  std::vector<std::pair<std::string, PlannerFactory>> entries{
      {"open", [] { return std::make_unique<policies::OpeningPlanner>(); }},
      {"close", [] { return std::make_unique<policies::OpeningPlanner>(); }},
      {"door_open", [] { return std::make_unique<policies::DoorPlanner>(); }},
      {"nav_to_obj", [] { return std::make_unique<policies::NavPlanner>(); }},
      {"nav_and_pick", make_nav_and_pick},
      {"pick_and_place", make_manipulation},
      {"pick_and_place_next_to", make_manipulation},
      {"pick_and_place_color", make_manipulation},
      {"packing", make_manipulation}};
};

Planners& planners() {
  static Planners all;
  return all;
}

bool has_its_own(const episode::Task& task) {
  Planners& all = planners();
  const std::lock_guard lock(all.mutex);
  return std::ranges::any_of(all.entries, [&](const auto& e) { return e.first == task.type(); });
}

// True for tasks without a specific planner that have objects to grasp.
bool picks(const episode::Task& task) { return task.grasp_scene() && !has_its_own(task); }
bool has_planner(const episode::Task& task) { return task.grasp_scene() || has_its_own(task); }

// Picks from above if possible, otherwise with the general manipulation planner.
class TopDownPlanner final : public CombinedPlanner {
 public:
  std::string_view name() const override { return "top_down_planner"; }
  void initialize(episode::Task& task) override {
    if (!picks(task)) {
      throw ValueError(
          fmt::format("policy '{}' supports picking tasks only; task '{}' is of type '{}'; policy "
                      "'planner' selects the planner by the task's type",
                      name(), task.name(), task.type()));
    }
    top_down_.initialize(task);
    any_direction_.initialize(task);
    current_.assign(task.num_worlds(), &top_down_);
  }
  void reset(const World& world) override {
    current_[world.id] = &top_down_;
    top_down_.reset(world);
    if (top_down_.last_failure(world.id) != policies::PlanFailure::kUnplanned) return;
    current_[world.id] = &any_direction_;
    any_direction_.reset(world);
  }
  std::span<const episode::Phase> phases() const override { return top_down_.phases(); }

 private:
  policies::PickPlanner top_down_;
  policies::ManipulationPlanner any_direction_;
};

// The task itself if it has a planner, or the first child that a planner exists for. Tasks without
// such a child are returned unchanged.
episode::Task& first_plannable(episode::Task& task) {
  if (has_its_own(task)) return task;
  for (const auto& child : task.children()) {
    if (has_planner(*child)) return *child;
  }
  return task;
}

class AnyPlanner final : public CombinedPlanner {
 public:
  std::string_view name() const override { return "planner"; }
  void bind(const std::shared_ptr<sim::Simulation>& simulation) override {
    simulation_ = simulation;
  }
  void initialize(episode::Task& task) override {
    episode::Task& doable = first_plannable(task);
    planner_ = make_planner(doable);
    if (simulation_) planner_->bind(simulation_);
    simulation_.reset();
    planner_->initialize(doable);
    current_.assign(doable.num_worlds(), planner_.get());
  }
  void reset(const World& world) override { planner_->reset(world); }
  void reset_all(episode::ActiveWorlds& worlds) override { planner_->reset_all(worlds); }
  void act_all(episode::ActiveWorlds& worlds, std::span<robots::Action> actions) override {
    planner_->act_all(worlds, actions);
  }
  std::span<const episode::Phase> phases() const override {
    return planner_ ? planner_->phases() : std::span<const episode::Phase>{};
  }
  bool has_grasp_pose() const override { return planner_ && planner_->has_grasp_pose(); }
  std::vector<std::shared_ptr<Sensor>> create_policy_sensors() const override {
    return planner_->create_policy_sensors();
  }

 private:
  std::unique_ptr<episode::PlannerPolicy> planner_;
  std::shared_ptr<sim::Simulation> simulation_;  // until it can be passed to planner_
};

}  // namespace

void register_planner(std::string task_type, PlannerFactory make) {
  if (task_type.empty()) throw ValueError("the task type of a planner is empty");
  Planners& all = planners();
  const std::lock_guard lock(all.mutex);
  for (const auto& [type, factory] : all.entries) {
    if (type == task_type)
      throw ValueError(fmt::format("a planner for tasks of type '{}' is already registered", type));
  }
  all.entries.emplace_back(std::move(task_type), std::move(make));
}

std::unique_ptr<episode::PlannerPolicy> make_planner(const episode::Task& task) {
  Planners& all = planners();
  PlannerFactory make;
  std::string types;
  {
    const std::lock_guard lock(all.mutex);
    for (const auto& [type, factory] : all.entries) {
      types += fmt::format("{}'{}'", types.empty() ? "" : ", ", type);
      if (type == task.type()) make = factory;
    }
  }
  if (make) return make();
  if (task.grasp_scene()) return make_manipulation();
  throw ValueError(
      fmt::format("policy 'planner' cannot do task '{}': it supports tasks of type {}, and picking "
                  "in tasks with a GraspScene",
                  task.name(), types));
}

std::unique_ptr<episode::Policy> make_any_planner() { return std::make_unique<AnyPlanner>(); }
std::unique_ptr<episode::Policy> make_top_down_planner() {
  return std::make_unique<TopDownPlanner>();
}

}  // namespace mjsense::tasks::rollout
