// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/hand_planner.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace mjsense::tasks::policies {
namespace {

constexpr double kJump = 0.15;    // rad per step of a line: 1.5 rad/s at 0.2 m/s
constexpr int kParts = 10;        // steps of reach_along()
constexpr double kDetour = 0.25;  // m upwards, of a floating hand whose straight line is blocked

// The joints of the hand's arm; for a floating hand the joints of the base.
std::vector<int> planned_joints(const robots::Robot& robot, const robots::Hand& hand) {
  if (!hand.floats()) return robot.groups()[hand.tool].joints;
  for (const robots::MoveGroup& group : robot.groups()) {
    if (group.kind == robots::GroupKind::kBase) return group.joints;
  }
  return {};
}

}  // namespace

HandPlanner::HandPlanner(const mjModel* model, const robots::Robot& robot, robots::Hand hand,
                         HandPlannerCfg cfg)
    : robot_(&robot), hand_(hand), cfg_(cfg) {
  collisions_ = std::make_unique<CollisionModel>(model, robot, planned_joints(robot, hand));
  if (floats()) {
    robots::RobotValues none;
    tool_base_ = inverse(robot.fk(hand.gripper, none));
    return;
  }
  for (int joint : robot.groups()[hand.tool].joints) {
    const bool slide = model->jnt_type[joint] == mjJNT_SLIDE;
    const bool limited = model->jnt_limited[joint];
    const double maximum = slide ? 10.0 : std::numbers::pi;
    const double* range = model->jnt_range + 2 * joint;
    space_.low.push_back(limited ? std::max(range[0], -2 * maximum) : -maximum);
    space_.high.push_back(limited ? std::min(range[1], 2 * maximum) : maximum);
    space_.speed.push_back(slide ? cfg.slide_speed : cfg.joint_speed);
    space_.acceleration.push_back(slide ? cfg.slide_acceleration : cfg.joint_acceleration);
  }
}

HandPose HandPlanner::now(const World& world, const Follower& follower) const {
  return {robot_->base_pose(world) * follower.tool_target(world, hand_.tool),
          follower.joints(world.id)};
}

bool HandPlanner::reach(const World& world, const Pose& tool, const HandPose& near, HandPose& out,
                        int iterations) const {
  out.joints = near.joints;
  out.tool = tool;
  if (floats()) return true;
  return robot_->ik(hand_.tool, inverse(robot_->base_pose(world)) * tool, out.joints, iterations);
}

bool HandPlanner::reach_along(const World& world, const Pose& tool, const HandPose& from,
                              HandPose& out) const {
  if (floats()) return reach(world, tool, from, out);
  const Twist screw = log6(inverse(from.tool) * tool);
  HandPose at = from;
  for (int k = 1; k <= kParts; ++k) {
    const Pose to =
        k == kParts ? tool : from.tool * exp6((static_cast<double>(k) / kParts) * screw);
    if (!reach(world, to, at, out)) return false;
    at = out;
  }
  return true;
}

bool HandPlanner::is_free(CollisionQuery& query, const HandPose& at) const {
  if (!floats()) return query.free(joints(at));
  query.place_base(base_of(at.tool));
  return query.free_here();
}

bool HandPlanner::line_is_free(const World& world, CollisionQuery& query, const HandPose& from,
                               const Pose& to, HandPose& end) const {
  const Twist screw = log6(inverse(from.tool) * to);
  const double length = std::max(norm(screw.v), 0.2 * norm(screw.w));
  const int steps = std::max(1, static_cast<int>(std::ceil(length / cfg_.line_step)));
  HandPose at = from;
  for (int k = 1; k <= steps; ++k) {
    const Pose tool = k == steps ? to : from.tool * exp6((static_cast<double>(k) / steps) * screw);
    if (!reach(world, tool, at, end)) return false;
    // If a joint jumps, the tool leaves the line.
    if (!floats()) {
      for (std::size_t i = 0; i < joints(at).size(); ++i) {
        if (std::abs(joints(end)[i] - joints(at)[i]) > kJump) return false;
      }
    }
    at = end;
    if (k < steps && !is_free(query, at)) return false;
  }
  return true;
}

Segment& HandPlanner::add_line(const World& world, Plan& plan, int phase, const Pose& from,
                               const Pose& to, double speed, double settle) const {
  if (floats())
    return plan.ease_tool(phase, hand_.tool, from, to, speed, settle, cfg_.turn_speed, true);
  const Pose to_base = inverse(robot_->base_pose(world));
  return plan.ease_tool(phase, hand_.tool, to_base * from, to_base * to, speed, settle,
                        cfg_.turn_speed, false);
}

bool HandPlanner::add_path(const World& world, CollisionQuery& query, Plan& plan, int phase,
                           const HandPose& from, const HandPose& to, Rng& rng) const {
  if (floats()) {
    HandPose end;
    if (line_is_free(world, query, from, to.tool, end)) {
      add_line(world, plan, phase, from.tool, to.tool, cfg_.tool_speed);
      return true;
    }
    // Up, across, down.
    const double top = std::max(from.tool.p.z, to.tool.p.z) + kDetour;
    Pose up = from.tool, over = to.tool;
    up.p.z = over.p.z = top;
    HandPose a, b;
    if (!line_is_free(world, query, from, up, a) || !line_is_free(world, query, a, over, b) ||
        !line_is_free(world, query, b, to.tool, end))
      return false;
    add_line(world, plan, phase, from.tool, up, cfg_.tool_speed);
    add_line(world, plan, phase, up, over, cfg_.tool_speed);
    add_line(world, plan, phase, over, to.tool, cfg_.tool_speed);
    return true;
  }
  const FreeSpace space{[&](std::span<const double> q) { return query.free(q); },
                        [&](std::span<const double> a, std::span<const double> b) {
                          return query.free_between(a, b);
                        }};
  const std::vector<double> path = find_path(space_, joints(from), joints(to), space, rng);
  if (path.empty()) return false;
  robots::RobotValues values = from.joints;
  const auto tool_position = [&](std::span<const double> q) {
    std::ranges::copy(q, values[hand_.tool].values.begin());
    return robot_->fk(hand_.tool, values).p;
  };
  plan.move_groups(phase,
                   {time_path(space_, hand_.tool, path, space, tool_position, cfg_.tool_speed)});
  return true;
}

}  // namespace mjsense::tasks::policies
