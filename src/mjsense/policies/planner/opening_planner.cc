// SPDX-License-Identifier: Apache-2.0
#include "mjsense/policies/planner/opening_planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/policies/planner/phases.h"

namespace mjsense {

std::span<const Phase> OpeningPlanner::phases() const { return kManipulationPhases; }
int OpeningPlanner::first_phase() const { return kOpenGripper; }

void OpeningPlanner::initialize_planner() {
  opening_ = dynamic_cast<const OpeningTask*>(&task());
  if (!opening_)
    throw ValueError(
        fmt::format("policy 'planner' opens and closes what task 'open' or 'close' names; it "
                    "cannot do task '{}'",
                    task().name()));
  if (opening_->reach().hands().empty())
    throw ValueError(fmt::format(
        "policy 'planner' needs an arm with a gripper; robot '{}' has none", robot().name()));
}

// Lets go of whatever it has and draws the hands back, before it looks again.
void OpeningPlanner::back_off(const World& world, Plan& plan) const {
  for (const ArmAndHand& hand : opening_->reach().hands())
    plan.wait(kOpenGripper, cfg_.close_time)
        .grip(hand.gripper, robot().groups()[hand.gripper].open_command);
  for (const ArmAndHand& hand : opening_->reach().hands()) {
    const Pose from = robot().tcp_pose(world, hand.arm);
    const Pose to = from * Pose{{0, 0, -cfg_.back}, {}};
    plan.move_tool(kRetreat, hand.arm, from, to, cfg_.fast, cfg_.settle);
  }
  plan.more = true;
}

void OpeningPlanner::make_plan(const World& world, const PlanRequest& request, Plan& plan) {
  if (request.attempt > 0 && request.stage == 0) return back_off(world, plan);
  const Articulation& one = opening_->target(world.id);
  const double from = world.data->qpos[one.qpos], to = opening_->aim(one);
  const auto way =
      opening_->reach().find(opening_->reach().start_of(world.data), one, from, to, cfg_.grasps);
  if (!way) return;
  const int arm = way->hand.arm, hand = way->hand.gripper;
  const MoveGroup& gripper = robot().groups()[hand];
  const std::size_t n = robot().groups()[arm].qpos.size();
  plan.grasp = way->grasp;

  // Joint positions at times, the tool at `speed` between them.
  const auto path = [&](std::span<const RobotValues> points, double speed, double turn) {
    CommandPath out{.group = arm};
    double time = 0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (k > 0) {
        const Pose a = robot().fk(arm, points[k - 1]), b = robot().fk(arm, points[k]);
        double most = 0;
        for (std::size_t i = 0; i < n; ++i)
          most = std::max(most, std::abs(points[k][arm].values[i] - points[k - 1][arm].values[i]));
        time += std::max({norm(b.p - a.p) / speed, most / turn, 1e-3});
      }
      out.times.push_back(time);
      const auto values = points[k][arm].values;
      out.points.insert(out.points.end(), values.begin(), values.begin() + n);
    }
    return out;
  };
  const Pose at = inverse(robot().base_pose(world)) * way->grasp;
  plan.wait(kOpenGripper, 0).grip(hand, gripper.open_command);
  plan.move_groups(kPregrasp, {path(way->go, cfg_.there, cfg_.fastest_joint)}, cfg_.settle);
  plan.move_tool(kGrasp, arm, way->pregrasp, at, cfg_.slow, cfg_.settle);
  plan.move_tool(kCloseGripper, arm, at, at, cfg_.slow, cfg_.close_time)
      .grip(hand, gripper.closed_command);
  plan.move_groups(kLift, {path(way->along, cfg_.fast, cfg_.fastest_joint)}, cfg_.settle)
      .holds(hand);
}

}  // namespace mjsense
