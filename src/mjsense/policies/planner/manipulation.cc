// SPDX-License-Identifier: Apache-2.0
#include "mjsense/policies/planner/manipulation.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

const GraspScene& grasp_scene_of(const Task& task) {
  if (const GraspScene* scene = task.grasp_scene()) return *scene;
  throw ValueError(fmt::format("policy 'planner' picks; it cannot do task '{}'", task.name()));
}

// Commands are steps to an arm's servos: the longer one lasts, the harder what is held is jerked. Rates hold for steps
// of kStep.
HandPlannerCfg gentle(HandPlannerCfg cfg, int policy_dt_ms) {
  constexpr int kStep = 66;  // ms
  const double rate = std::min(1.0, static_cast<double>(kStep) / policy_dt_ms);
  cfg.joint_speed *= rate;
  cfg.slide_speed *= rate;
  cfg.tool_speed *= rate;
  cfg.joint_acceleration *= rate * rate;
  cfg.slide_acceleration *= rate * rate;
  return cfg;
}

}  // namespace

Manipulation::Manipulation(const Task& task, const ManipulationPlannerCfg& cfg)
    : task_(task), cfg_(cfg), scene_(grasp_scene_of(task)) {
  const HandPlannerCfg hand_cfg = gentle(cfg.hand, task.cfg().policy_dt_ms);
  for (const Hand& hand : hands_of(robot(), task.model())) {
    hands_.push_back(std::make_unique<HandPlanner>(task.model(), robot(), hand, hand_cfg));
    grippers_.emplace_back(task.model(), robot(), hand.gripper);
  }
  if (hands_.empty())
    throw ValueError(fmt::format(
        "policy 'planner' needs an arm and a gripper; robot '{}' lacks one", robot().name()));
}

Pose Manipulation::object_pose(const World& world) const {
  const int body = target_body(world.id);
  return {vec3(world.data->xpos + 3 * body), quat(world.data->xquat + 4 * body)};
}

Rng Manipulation::rng(const World& world, const PlanRequest& request, std::string_view what) const {
  return {task_.cfg().seed, static_cast<std::uint32_t>(8 * request.attempt + request.stage),
          stream_of(what), static_cast<std::uint64_t>(task_.episode(world.id))};
}

}  // namespace mjsense
