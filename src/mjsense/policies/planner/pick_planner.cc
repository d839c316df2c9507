// SPDX-License-Identifier: Apache-2.0
#include "mjsense/policies/planner/pick_planner.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/policies/planner/phases.h"

namespace mjsense::policies {
namespace {

// m, clearance between gripper and all objects on the path to the pregrasp, including the target:
// at the end of the fast segment the tool is 2 cm behind its command, and fingers that are already
// next to a tall object would push it over.
constexpr double kPathMargin = 0.008;
constexpr double kGraspMargin = 0.003;  // m, at the grasp
constexpr double kPathStep = 0.01;      // m

Pose raised(Pose pose, double height) {
  pose.p.z += height;
  return pose;
}

Pose object_pose(const World& world, int body) {
  return {vec3(world.data->xpos + 3 * body), quat(world.data->xquat + 4 * body)};
}

}  // namespace

std::span<const episode::Phase> PickPlanner::phases() const { return kManipulationPhases; }

int PickPlanner::first_phase() const { return kOpenGripper; }

bool PickPlanner::can_use(const robots::Robot& robot) {
  return robot.arm() >= 0 && robot.gripper() >= 0 && robot.groups()[robot.arm()].leaf_site >= 0 &&
         std::ranges::equal(robot.chain(robot.arm()).joints(), robot.groups()[robot.arm()].joints);
}

void PickPlanner::initialize_planner() {
  scene_ = task().grasp_scene();
  if (!scene_)
    throw ValueError(fmt::format(
        "policy 'planner' supports picking tasks only; it cannot do task '{}'", task().name()));
  if (can_use(robot())) {
    gripper_shape_ = std::make_unique<GripperShape>(task().model(), robot(), robot().gripper());
    return;
  }
  if (robot().arm() < 0 || robot().gripper() < 0)
    throw ValueError(
        fmt::format("policy 'planner' needs an arm and a gripper; robot '{}' does not have both",
                    robot().name()));
  throw ValueError(
      fmt::format("policy 'planner' moves the tool by the joints of the arm only; the tool of "
                  "robot '{}' also moves with other groups",
                  robot().name()));
}

void PickPlanner::read_arm(const World& world, std::span<double> q) const {
  const auto& address = robot().groups()[robot().arm()].qpos;
  for (std::size_t i = 0; i < address.size(); ++i) q[i] = world.data->qpos[address[i]];
}

void PickPlanner::make_plan(const World& world, const PlanRequest& /*request*/, Plan& plan) {
  const int arm = robot().arm(), gripper = robot().gripper();
  Grasp grasp;
  if (!choose_grasp(world, grasp)) return;
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

bool PickPlanner::choose_grasp(const World& world, Grasp& chosen) const {
  const robots::Robot& robot = this->robot();
  const auto objects = scene_->all_objects();
  const auto& target = objects[scene_->target(world.id)];
  const Pose tool = robot.leaf_pose(world, robot.arm()), base = robot.base_pose(world);
  const std::vector<Grasp> grasps =
      propose_grasps(*gripper_shape_, scene_->shape(world.id, scene_->target(world.id)),
                     object_pose(world, target.body), scene_->support_height(world.id), tool);
  std::array<double, robots::Chain::kMaxJoints> q;
  read_arm(world, q);
  int tried = 0;
  const Grasp* second_best = nullptr;  // reachable, but its path is blocked
  for (const Grasp& grasp : grasps) {
    bool blocked = false;
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const int body = objects[i].body;
      if (body == target.body) continue;
      blocked = blocked ||
                gripper_shape_->hits(grasp.pose, object_pose(world, body),
                                     scene_->shape(world.id, static_cast<int>(i)), kGraspMargin);
    }
    if (blocked) continue;
    if (++tried > cfg_.max_ik_candidates) break;
    if (!reachable(base, grasp.pose, q)) continue;
    if (path_is_free(world, tool, raised(grasp.pose, cfg_.pregrasp_height))) {
      chosen = grasp;
      return true;
    }
    if (!second_best) second_best = &grasp;
  }
  if (!second_best) return false;
  chosen = *second_best;
  return true;
}

bool PickPlanner::reachable(const Pose& base, const Pose& grasp, std::span<const double> q) const {
  const robots::Chain& chain = robot().chain(robot().arm());
  std::array<double, robots::Chain::kMaxJoints> solution;
  std::copy_n(q.begin(), chain.joints().size(), solution.begin());
  const std::span<double> s(solution.data(), chain.joints().size());
  const Pose to_base = inverse(base);
  // Solved in the order of the motion, each from the previous solution, as the follower does; so a
  // solution found here is found while following.
  return chain.ik(to_base * raised(grasp, cfg_.pregrasp_height), s, robots::Chain::kTracking) &&
         chain.ik(to_base * grasp, s, robots::Chain::kTracking) &&
         chain.ik(to_base * raised(grasp, cfg_.lift_height), s, robots::Chain::kTracking);
}

bool PickPlanner::path_is_free(const World& world, const Pose& tool, const Pose& pregrasp) const {
  const Twist screw = log6(inverse(tool) * pregrasp);
  const int steps = std::max(1, static_cast<int>(norm(screw.v) / kPathStep));
  const auto objects = scene_->all_objects();
  for (int i = 1; i <= steps; ++i) {
    const Pose at = tool * exp6((static_cast<double>(i) / steps) * screw);
    for (std::size_t k = 0; k < objects.size(); ++k) {
      if (gripper_shape_->hits(at, object_pose(world, objects[k].body),
                               scene_->shape(world.id, static_cast<int>(k)), kPathMargin))
        return false;
    }
  }
  return true;
}

}  // namespace mjsense::policies
