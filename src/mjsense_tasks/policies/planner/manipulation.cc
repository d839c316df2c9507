// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/manipulation.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"

namespace mjsense::tasks::policies {
namespace {

const episode::GraspScene& grasp_scene_of(const episode::Task& task) {
  if (const episode::GraspScene* scene = task.grasp_scene()) return *scene;
  throw ValueError(fmt::format(
      "policy 'planner' supports picking tasks only; it cannot do task '{}'", task.name()));
}

}  // namespace

Manipulation::Manipulation(const episode::Task& task, const ManipulationPlannerCfg& cfg)
    : task_(task), cfg_(cfg), scene_(grasp_scene_of(task)) {
  for (const robots::Hand& hand : robots::hands_of(robot(), task.model())) {
    hands_.push_back(std::make_unique<HandPlanner>(task.model(), robot(), hand, cfg.hand));
    grippers_.emplace_back(task.model(), robot(), hand.gripper);
  }
  if (hands_.empty())
    throw ValueError(
        fmt::format("policy 'planner' needs an arm and a gripper; robot '{}' does not have both",
                    robot().name()));
}

Pose Manipulation::object_pose(const World& world) const {
  return body_pose(world.data, target_body(world.id));
}

Rng Manipulation::rng(const World& world, const PlanRequest& request, std::string_view what) const {
  return {task_.cfg().seed, static_cast<std::uint32_t>(8 * request.attempt + request.stage),
          stream_of(what), static_cast<std::uint64_t>(task_.episode(world.id))};
}

}  // namespace mjsense::tasks::policies
