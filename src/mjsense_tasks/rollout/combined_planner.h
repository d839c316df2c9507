// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base class of planners that leave each world to one of several other planners.

#include <string>
#include <utility>
#include <vector>

#include "mjsense_tasks/episode/policy.h"

namespace mjsense::tasks::rollout {

class CombinedPlanner : public episode::PlannerPolicy {
 public:
  void act(const World& world, robots::Action& action) override {
    current_[world.id]->act(world, action);
  }
  int phase(int world) const override { return current_[world]->phase(world); }
  int num_retries(int world) const override { return current_[world]->num_retries(world); }
  Pose grasp_pose(int world) const override { return current_[world]->grasp_pose(world); }
  std::vector<episode::PlannedPath> planned_paths(const World& world) const override {
    return current_[world.id]->planned_paths(world);
  }
  std::string failure(int world) const override { return current_[world]->failure(world); }
  std::vector<std::pair<std::string, std::string>> info(int world) const override {
    return current_[world]->info(world);
  }

 protected:
  std::vector<episode::PlannerPolicy*> current_;  // [B] the planner of each world
};

}  // namespace mjsense::tasks::rollout
