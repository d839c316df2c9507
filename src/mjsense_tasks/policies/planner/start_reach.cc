// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/start_reach.h"

#include "mjsense_tasks/scenes/robot_floor.h"

namespace mjsense::tasks::policies {

std::unique_ptr<StartReach> StartReach::make(const episode::Task& task) {
  const robots::Robot& robot = task.robot();
  if (!task.grasp_scene() || robots::hands_of(robot, task.model()).empty() ||
      scenes::driving_base(robot) >= 0)
    return nullptr;
  return std::make_unique<StartReach>(task);
}

StartReach::StartReach(const episode::Task& task)
    : shared_(task, cfg_),
      placing_(shared_),
      picking_(shared_, shared_.scene().place_scene() ? &placing_ : nullptr),
      follower_(cfg_.planner.follower) {
  follower_.initialize(task.robot(), task.model(), task.num_worlds(),
                       0.001 * task.cfg().policy_dt_ms);
}

bool StartReach::operator()(const World& world) {
  follower_.reset(world);
  Plan unused;
  return picking_.plan(world, {}, follower_, {}, unused).has_value();
}

}  // namespace mjsense::tasks::policies
