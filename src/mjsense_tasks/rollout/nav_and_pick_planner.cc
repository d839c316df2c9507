// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/nav_and_pick_planner.h"

#include <array>

#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/policies/planner/phases.h"

namespace mjsense::tasks::rollout {
namespace {

constexpr int kNavigate = 10;
// The picking planner moves the base by up to 0.5 m to a pose from which the arm reaches the object.
constexpr policies::NavPlannerCfg kNear{.arrive = 0.75, .reach = 1.0};

constexpr auto kPhases = [] {
  std::array<episode::Phase, std::size(policies::kManipulationPhases) + 1> all{};
  for (std::size_t i = 0; i + 1 < all.size(); ++i) all[i] = policies::kManipulationPhases[i];
  all.back() = {"navigate", kNavigate};
  return all;
}();

}  // namespace

NavAndPickPlanner::NavAndPickPlanner() : drive_(kNear) {}

void NavAndPickPlanner::initialize(episode::Task& task) {
  drive_.initialize(*task.children()[0]);
  pick_.initialize(*task.children()[1]);
  current_.assign(task.num_worlds(), &drive_);
}

void NavAndPickPlanner::reset(const World& world) {
  current_[world.id] = &drive_;
  drive_.reset(world);
}

void NavAndPickPlanner::act(const World& world, robots::Action& action) {
  CombinedPlanner::act(world, action);
  const bool arrived = action.done && action.success != false;
  if (picks(world.id) || !arrived) return;
  current_[world.id] = &pick_;
  pick_.reset(world);
  pick_.act(world, action);
}

std::span<const episode::Phase> NavAndPickPlanner::phases() const { return kPhases; }

int NavAndPickPlanner::phase(int world) const {
  return picks(world) ? pick_.phase(world) : kNavigate;
}

int NavAndPickPlanner::num_retries(int world) const {
  return drive_.num_retries(world) + (picks(world) ? pick_.num_retries(world) : 0);
}

}  // namespace mjsense::tasks::rollout
