// SPDX-License-Identifier: Apache-2.0
#pragma once
// Planner of nav_and_pick: drives with the planner of the task's first child, and when it has
// arrived, picks with that of the second.

#include <memory>
#include <string>
#include <vector>

#include "mjsense/policies/navigation/nav_planner.h"
#include "mjsense/policies/planner/manipulation_planner.h"

namespace mjsense::rollout {

class NavAndPickPlanner final : public episode::PlannerPolicy {
 public:
  NavAndPickPlanner();
  std::string_view name() const override { return "planner"; }
  void initialize(episode::Task& task) override;
  void reset(const World& world) override;
  void act(const World& world, robots::Action& action) override;
  std::span<const episode::Phase> phases() const override;
  int phase(int world) const override;
  int num_retries(int world) const override;
  Pose grasp_pose(int world) const override {
    return picks_[world] ? pick_.grasp_pose(world) : Pose{};
  }
  std::vector<episode::PlannedPath> planned_paths(const World& world) const override {
    return current(world.id).planned_paths(world);
  }
  std::string failure(int world) const override { return current(world).failure(world); }

 private:
  const policies::TaskPlanner& current(int world) const {
    return picks_[world] ? static_cast<const policies::TaskPlanner&>(pick_) : drive_;
  }

  policies::NavPlanner drive_;
  policies::ManipulationPlanner pick_;
  std::vector<char> picks_;  // [B], 1: the robot has arrived
};

}  // namespace mjsense::rollout
