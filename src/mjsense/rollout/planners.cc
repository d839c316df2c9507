// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rollout/planners.h"

#include <fmt/format.h>

#include <mutex>
#include <utility>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/policies/planner/opening_planner.h"
#include "mjsense/policies/planner/pick_planner.h"

namespace mjsense {
namespace {

struct Planners {
  std::mutex mutex;
  // By task type; ours, then others in the order in which they came.
  std::vector<std::pair<std::string, PlannerFactory>> entries{
      {"pick", [] { return std::make_unique<PickPlanner>(); }},
      {"open", [] { return std::make_unique<OpeningPlanner>(); }},
      {"close", [] { return std::make_unique<OpeningPlanner>(); }}};
};

Planners& planners() {
  static Planners all;
  return all;
}

class AnyPlanner final : public PlannerPolicy {
 public:
  std::string_view name() const override { return "planner"; }
  void bind(const std::shared_ptr<Simulation>& simulation) override { simulation_ = simulation; }
  void initialize(Task& task) override {
    planner_ = make_planner(task);
    if (simulation_) planner_->bind(simulation_);
    simulation_.reset();
    planner_->initialize(task);
  }
  void reset(const World& world) override { planner_->reset(world); }
  void act(const World& world, Action& action) override { planner_->act(world, action); }
  void reset_all(ActiveWorlds& worlds) override { planner_->reset_all(worlds); }
  void act_all(ActiveWorlds& worlds, std::span<Action> actions) override {
    planner_->act_all(worlds, actions);
  }
  std::span<const Phase> phases() const override {
    return planner_ ? planner_->phases() : std::span<const Phase>{};
  }
  int phase(int world) const override { return planner_->phase(world); }
  int num_retries(int world) const override { return planner_->num_retries(world); }
  Pose grasp_pose(int world) const override { return planner_->grasp_pose(world); }
  bool has_grasp_pose() const override { return planner_ && planner_->has_grasp_pose(); }
  std::vector<std::shared_ptr<Sensor>> create_policy_sensors() const override {
    return planner_->create_policy_sensors();
  }

 private:
  std::unique_ptr<PlannerPolicy> planner_;
  std::shared_ptr<Simulation> simulation_;  // until there is a planner to be bound to it
};

}  // namespace

void register_planner(std::string task_type, PlannerFactory make) {
  if (task_type.empty()) throw ValueError("a planner needs the type of its tasks");
  Planners& all = planners();
  const std::lock_guard lock(all.mutex);
  for (const auto& [type, factory] : all.entries) {
    if (type == task_type)
      throw ValueError(fmt::format("there is a planner for tasks of type '{}' already", type));
  }
  all.entries.emplace_back(std::move(task_type), std::move(make));
}

std::unique_ptr<PlannerPolicy> make_planner(const Task& task) {
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
  if (task.grasp_scene()) return std::make_unique<PickPlanner>();
  throw ValueError(fmt::format(
      "policy 'planner' cannot do task '{}': it knows tasks of type {}, and picks where "
      "a task has a GraspScene",
      task.name(), types));
}

std::unique_ptr<Policy> make_any_planner() { return std::make_unique<AnyPlanner>(); }

}  // namespace mjsense
