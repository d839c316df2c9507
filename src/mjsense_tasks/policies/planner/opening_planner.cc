// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/opening_planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense_tasks/policies/planner/phases.h"

namespace mjsense::tasks::policies {

std::span<const episode::Phase> OpeningPlanner::phases() const { return kManipulationPhases; }
int OpeningPlanner::first_phase() const { return kOpenGripper; }

void OpeningPlanner::initialize_planner() {
  opening_ = dynamic_cast<const tasks::OpeningTask*>(&task());
  if (!opening_)
    throw ValueError(
        fmt::format("policy 'planner': the opening planner supports tasks 'open' and 'close'; "
                    "it cannot do task '{}'",
                    task().name()));
  if (opening_->reach().hands().empty())
    throw ValueError(fmt::format(
        "policy 'planner' needs a gripper on an arm or a floating gripper; robot '{}' has none",
        robot().name()));
  paths_.assign(task().num_worlds(), {});
}

// Opens the grippers and retracts the hands before the next attempt.
void OpeningPlanner::back_off(const World& world, Plan& plan) const {
  for (const tasks::OrientedHand& hand : opening_->reach().hands())
    plan.wait(kOpenGripper, cfg_.close_time)
        .grip(hand.gripper, robot().groups()[hand.gripper].open_command);
  for (const tasks::OrientedHand& hand : opening_->reach().hands()) {
    const Pose from = robot().tcp_pose(world, hand.tool);
    const Pose to = from * Pose{{0, 0, -cfg_.back}, {}};
    if (hand.floats()) {
      const Pose base = robot().base_pose(world);
      add_move(plan, kRetreat, hand, base * from, base * to, cfg_.fast);
    } else {
      plan.move_tool(kRetreat, hand.tool, from, to, cfg_.fast, cfg_.settle);
    }
  }
  plan.more = true;
}

Segment& OpeningPlanner::add_move(Plan& plan, int phase, const tasks::OrientedHand& hand,
                                  const Pose& from, const Pose& to, double speed,
                                  double settle) const {
  return plan.ease_tool(phase, hand.tool, from, to, speed, std::max(settle, cfg_.settle), cfg_.turn,
                        true);
}

void OpeningPlanner::plan_floating(const World& world, const tasks::HandlePath& path,
                                   bool with_approach, Plan& plan) const {
  const robots::MoveGroup& gripper = robot().groups()[path.hand.gripper];
  Pose at = robot().base_pose(world) * tool_target(world, path.hand.tool);
  if (with_approach) {
    plan.wait(kOpenGripper, 0).grip(path.hand.gripper, gripper.open_command);
    for (const Pose& next : std::span(path.approach).subspan(1)) {
      add_move(plan, kPregrasp, path.hand, at, next, cfg_.approach_speed);
      at = next;
    }
    return;
  }
  add_move(plan, kGrasp, path.hand, at, path.grasp, cfg_.slow);
  add_move(plan, kCloseGripper, path.hand, path.grasp, path.grasp, cfg_.slow, cfg_.close_time)
      .grip(path.hand.gripper, gripper.closed_command);
  // A rotation about a hinge and a translation along a slide are both screws. The fingers may close
  // before a handle that they push, which slides towards the palm.
  const bool pushes = opening_->kind() == tasks::OpeningKind::kClose;
  Segment& move =
      add_move(plan, kLift, path.hand, path.grasp, path.end, pushes ? cfg_.push : cfg_.fast);
  if (!pushes) move.holds(path.hand.gripper);
}

// Timed joint positions and, with `driving`, poses of the mobile base; the tool moves at `speed`.
std::vector<CommandPath> OpeningPlanner::paths(int arm, std::span<const robots::RobotValues> points,
                                               double speed, bool driving) const {
  const std::size_t n = robot().groups()[arm].qpos.size();
  const int base = opening_->reach().base();
  const auto pose = [&](const robots::RobotValues& q) {
    const auto& at = q[base].values;
    return scenes::BasePose{at[0], at[1], at[2]}.at_height(0);
  };
  std::vector<double> seconds{0};
  for (std::size_t k = 1; k < points.size(); ++k) {
    Pose a = robot().fk(arm, points[k - 1]), b = robot().fk(arm, points[k]);
    double maximum = 0, minimum = 1e-3;
    for (std::size_t i = 0; i < n; ++i)
      maximum =
          std::max(maximum, std::abs(points[k][arm].values[i] - points[k - 1][arm].values[i]));
    if (driving) {
      const Pose from = pose(points[k - 1]), to = pose(points[k]);
      minimum = std::max(norm(to.p - from.p) / cfg_.base_speed,
                         angle_between(from.q, to.q) / cfg_.base_turn);
      a = from * a;
      b = to * b;
    }
    seconds.push_back(std::max({norm(b.p - a.p) / speed, maximum / cfg_.fastest_joint, minimum}));
  }
  if (driving) ease(std::span(seconds).subspan(1));
  std::vector<CommandPath> out(driving ? 2 : 1);
  double time = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    time += seconds[k];
    for (CommandPath& path : out) {
      path.group = &path == out.data() ? arm : base;
      const auto view = points[k][path.group].view();
      path.times.push_back(time);
      path.points.insert(path.points.end(), view.begin(), view.end());
    }
  }
  return out;
}

// Stages: move to the pregrasp; plan again from there for the measured handle pose, grasp it and
// follow its path; check success.
void OpeningPlanner::make_plan(const World& world, const PlanRequest& request, Plan& plan) {
  const int first = request.attempt > 0 ? 1 : 0;  // stage
  if (request.stage < first) return back_off(world, plan);
  if (request.stage > first + 1) {
    const episode::Evaluation now = task().evaluate(world);
    if (now.success) {
      plan.wait(kLift, 0);
    } else {
      plan.rejection = fmt::format("after the last motion, {}", now.missing);
    }
    return;
  }
  const tasks::HandleReach& reach = opening_->reach();
  const tasks::Articulation& one = opening_->target(world.id);
  const double from = world.data->qpos[one.qpos], to = opening_->aim(one);
  tasks::HandlePath& path = paths_[world.id];
  const auto start = reach.start_of(world);
  std::optional<tasks::HandlePath> found;
  if (request.stage > first) {
    found = reach.again(start, one, from, to, path);
  } else {
    const bool driving = opening_->driving(world.id);
    for (const bool drive : {driving, !driving}) {
      if (!found) found = reach.find(start, one, from, to, cfg_.grasps, drive);
    }
  }
  if (!found) {
    plan.rejection = "no grasp of the handle allows a collision-free motion along its whole path";
    return;
  }
  path = *std::move(found);
  plan.grasp = path.grasp;
  if (path.hand.floats()) {
    plan_floating(world, path, request.stage == first, plan);
    plan.more = true;
    return;
  }
  const int arm = path.hand.tool, hand = path.hand.gripper;
  const robots::MoveGroup& gripper = robot().groups()[hand];
  if (request.stage == first) {
    plan.wait(kOpenGripper, 0).grip(hand, gripper.open_command);
    plan.move_groups(kPregrasp, paths(arm, path.approach_joints, cfg_.approach_speed, false),
                     cfg_.settle);
    plan.more = true;
    return;
  }
  const Pose at = inverse(robot().base_pose(world)) * path.grasp;
  plan.move_tool(kGrasp, arm, tool_target(world, arm), at, cfg_.slow, cfg_.settle);
  plan.move_tool(kCloseGripper, arm, at, at, cfg_.slow, cfg_.close_time)
      .grip(hand, gripper.closed_command);
  plan.move_groups(kLift,
                   paths(arm, path.motion_joints, path.drive ? cfg_.driving : cfg_.fast,
                         path.drive.has_value()),
                   cfg_.settle)
      .holds(hand);
  plan.more = true;
}

}  // namespace mjsense::tasks::policies
