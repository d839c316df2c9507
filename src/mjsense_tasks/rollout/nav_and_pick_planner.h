// SPDX-License-Identifier: Apache-2.0
#pragma once
// Planner of nav_and_pick: drives with the planner of the task's first child, and when it has
// arrived, picks with that of the second.

#include "mjsense_tasks/policies/navigation/nav_planner.h"
#include "mjsense_tasks/policies/planner/manipulation_planner.h"
#include "mjsense_tasks/rollout/combined_planner.h"

namespace mjsense::tasks::rollout {

class NavAndPickPlanner final : public CombinedPlanner {
 public:
  NavAndPickPlanner();
  std::string_view name() const override { return "planner"; }
  void initialize(episode::Task& task) override;
  void reset(const World& world) override;
  void act(const World& world, robots::Action& action) override;
  std::span<const episode::Phase> phases() const override;
  int phase(int world) const override;
  int num_retries(int world) const override;

 private:
  bool picks(int world) const { return current_[world] == &pick_; }

  policies::NavPlanner drive_;
  policies::ManipulationPlanner pick_;
};

}  // namespace mjsense::tasks::rollout
