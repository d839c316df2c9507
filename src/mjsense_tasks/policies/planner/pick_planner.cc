// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/pick_planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense_tasks/policies/planner/phases.h"
#include "mjsense_tasks/policies/planner/rejections.h"

namespace mjsense::tasks::policies {
namespace {

// m, clearance between gripper and all objects on the path to the pregrasp, including the target:
// at the end of the fast segment the tool is 2 cm behind its command, and fingers that are already
// next to a tall object would push it over.
constexpr double kPathMargin = 0.008;
constexpr double kPickMargin = 0.003;  // m, at the grasp
constexpr double kPathStep = 0.01;     // m

}  // namespace

std::span<const episode::Phase> PickPlanner::phases() const { return kManipulationPhases; }

int PickPlanner::first_phase() const { return kOpenGripper; }

void PickPlanner::initialize_planner() {
  scene_ = task().grasp_scene();
  if (!scene_)
    throw ValueError(
        fmt::format("policy 'top_down_planner' supports picking tasks only; it cannot do task '{}'",
                    task().name()));
  const int arm = robot().arm(), gripper = robot().gripper();
  if (arm < 0 || gripper < 0 || robot().groups()[arm].leaf_site < 0 ||
      !std::ranges::equal(robot().chain(arm).joints(), robot().groups()[arm].joints))
    throw ValueError(fmt::format(
        "policy 'top_down_planner' needs a gripper that only the joints of an arm move; robot '{}' "
        "has none: policy 'planner' picks with any gripper",
        robot().name()));
  gripper_shape_ = std::make_unique<GripperShape>(task().model(), robot(), gripper);
}

void PickPlanner::make_plan(const World& world, const PlanRequest& /*request*/, Plan& plan) {
  const int arm = robot().arm(), gripper = robot().gripper();
  Grasp grasp;
  if (!choose_grasp(world, grasp, plan.rejection)) return;
  plan.grasp = grasp.pose;

  const Pose to_base = inverse(robot().base_pose(world));
  const Pose start = robot().tcp_pose(world, arm), at = to_base * grasp.pose;
  const Pose before = to_base * raised(grasp.pose, cfg_.pregrasp_height);
  const Pose after = to_base * raised(grasp.pose, cfg_.lift_height);
  const double open = robot().groups()[gripper].open_command;
  const double closed = robot().groups()[gripper].closed_command;
  plan.wait(kOpenGripper, 0).grip(gripper, open);
  plan.move_tool(kPregrasp, arm, start, before, cfg_.fast);
  plan.move_tool(kGrasp, arm, before, at, cfg_.slow, cfg_.settle);
  plan.move_tool(kCloseGripper, arm, at, at, cfg_.slow, cfg_.close_time).grip(gripper, closed);
  plan.move_tool(kLift, arm, at, after, cfg_.slow).holds(gripper);
}

bool PickPlanner::choose_grasp(const World& world, Grasp& chosen, std::string& why) const {
  const robots::Robot& robot = this->robot();
  const auto objects = scene_->all_objects();
  const auto& target = objects[scene_->target(world.id)];
  const Pose tool = robot.leaf_pose(world, robot.arm()), base = robot.base_pose(world);
  const std::vector<Grasp> grasps =
      propose_grasps(*gripper_shape_, scene_->shape(world.id, scene_->target(world.id)),
                     body_pose(world.data, target.body), scene_->support_height(world.id), tool);
  robots::RobotValues joints;
  robot.read_qpos(world, joints);
  int tried = 0;
  std::vector<Rejection> rejections;
  const Grasp* second_best = nullptr;  // reachable, but its path is blocked
  for (const Grasp& grasp : grasps) {
    bool blocked = false;
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const int body = objects[i].body;
      if (body == target.body) continue;
      blocked = blocked ||
                gripper_shape_->hits(grasp.pose, body_pose(world.data, body),
                                     scene_->shape(world.id, static_cast<int>(i)), kPickMargin);
    }
    if (blocked) {
      rejections.push_back({"with another object in the way"});
      continue;
    }
    if (++tried > cfg_.max_ik_candidates) break;
    if (!reachable(base, grasp.pose, joints)) {
      rejections.push_back({"out of reach"});
      continue;
    }
    if (path_is_free(world, tool, raised(grasp.pose, cfg_.pregrasp_height))) {
      chosen = grasp;
      return true;
    }
    if (!second_best) second_best = &grasp;
  }
  if (!second_best) {
    why = text_of("grasps from above", rejections, world.model);
    return false;
  }
  chosen = *second_best;
  return true;
}

bool PickPlanner::reachable(const Pose& base, const Pose& grasp, robots::RobotValues joints) const {
  // Solved in the order of the motion, each from the previous solution, as the follower does; so a
  // solution found here is found while following.
  return std::ranges::all_of(
      std::array{cfg_.pregrasp_height, 0.0, cfg_.lift_height}, [&](double height) {
        return robot().ik(robot().arm(), inverse(base) * raised(grasp, height), joints,
                          robots::Chain::kTracking);
      });
}

bool PickPlanner::path_is_free(const World& world, const Pose& tool, const Pose& pregrasp) const {
  const Twist screw = log6(inverse(tool) * pregrasp);
  const int steps = std::max(1, static_cast<int>(norm(screw.v) / kPathStep));
  const auto objects = scene_->all_objects();
  for (int i = 1; i <= steps; ++i) {
    const Pose at = tool * exp6((static_cast<double>(i) / steps) * screw);
    for (std::size_t k = 0; k < objects.size(); ++k) {
      if (gripper_shape_->hits(at, body_pose(world.data, objects[k].body),
                               scene_->shape(world.id, static_cast<int>(k)), kPathMargin))
        return false;
    }
  }
  return true;
}

}  // namespace mjsense::tasks::policies
