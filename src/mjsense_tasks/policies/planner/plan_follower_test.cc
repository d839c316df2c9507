// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/plan_follower.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mjsense/core/testing/allocations.h"
#include "mjsense_tasks/policies/planner/task_planner.h"
#include "mjsense_tasks/policies/planner/testing/table_scene.h"

namespace mjsense::tasks::policies {
namespace {

Pose moved(Pose pose, Vec3 by) {
  pose.p = pose.p + by;
  return pose;
}

TEST(Follower, TwoToolsMoveAtTheSameTimeAndGrippersKeepTheirCommand) {
  TableStage stage("bimanual_yam");
  const robots::Robot& robot = stage.robot();
  const auto hands = robots::hands_of(robot, stage.world.model);
  ASSERT_EQ(hands.size(), 2u);
  Follower follower;
  follower.initialize(robot, stage.world.model, 1);
  follower.restart(stage.world);
  Plan& plan = follower.plan(0);
  Pose from[2], to[2];
  for (int k = 0; k < 2; ++k) {
    from[k] = follower.tool_target(stage.world, hands[k].tool);
    to[k] = moved(from[k], {0.05, 0, 0.04 + 0.02 * k});
  }
  plan.move_tool(1, hands[0].tool, from[0], to[0], 0.1, 1.0);
  plan.segments[0].tools.push_back({hands[1].tool, from[1], log6(inverse(from[1]) * to[1]), 0.5});
  plan.segments[0].grip(hands[0].gripper, 0.0);
  plan.wait(2, 0.5);
  follower.begin(stage.world);
  int steps = 0;
  for (; !follower.finished(0) && steps < 100; ++steps) {
    robots::Action action;
    const AllocationCount count;
    follower.follow(stage.world, action);
    EXPECT_EQ(count.since(), 0) << "while following";
    EXPECT_FALSE(action.commands[hands[1].gripper].given) << "the plan does not command it";
    ASSERT_TRUE(action.commands[hands[0].gripper].given);
    EXPECT_EQ(action.commands[hands[0].gripper].values[0], 0.0);
    EXPECT_EQ(follower.failure(stage.world), PlanFailure::kNone);
    stage.step(action);
  }
  const double seconds = norm(to[0].p - from[0].p) / 0.1 + 1.5;
  EXPECT_EQ(steps, static_cast<int>(std::ceil(seconds / 0.066)) + 1);
  for (int k = 0; k < 2; ++k)
    EXPECT_LT(norm(robot.tcp_pose(stage.world, hands[k].tool).p - to[k].p), 0.01) << k;
}

TEST(Follower, ABaseDrivesAlongAPathWhileTheToolStaysInTheWorld) {
  TableStage stage("mobile_franka");
  const robots::Robot& robot = stage.robot();
  const int base = robot.group_index("base"), arm = robot.arm();
  Follower follower;
  follower.initialize(robot, stage.world.model, 1);
  follower.restart(stage.world);
  const Pose tool = robot.leaf_pose(stage.world, arm);
  const Pose start = robot.base_pose(stage.world);
  robots::RobotValues now;
  robot.read_qpos(stage.world, now);
  CommandPath path{base, {0, 2}, {}};
  for (double back : {0.0, 0.08}) {
    const double at[3] = {now[base].values[0] - back, now[base].values[1], now[base].values[2]};
    path.points.insert(path.points.end(), at, at + 3);
  }
  Plan& plan = follower.plan(0);
  plan.move_groups(1, {path}, 1.0);
  plan.segments[0].tools.push_back({arm, tool, {}, 0, true});
  follower.begin(stage.world);
  while (!follower.finished(0)) {
    robots::Action action;
    follower.follow(stage.world, action);
    ASSERT_EQ(follower.failure(stage.world), PlanFailure::kNone);
    stage.step(action);
    EXPECT_LT(norm(robot.leaf_pose(stage.world, arm).p - tool.p), 0.03);
  }
  EXPECT_NEAR(norm(robot.base_pose(stage.world).p - start.p), 0.08, 0.01);
  EXPECT_LT(norm(robot.leaf_pose(stage.world, arm).p - tool.p), 0.01);
}

// A path starts away from the base, and the plan is aborted while the base drives. The commanded
// speed changes within its limits and becomes zero.
TEST(Follower, BaseCommandsStayWithinTheAccelerationLimits) {
  constexpr double kDt = 0.066;
  TableStage stage("mobile_franka");
  const robots::Robot& robot = stage.robot();
  const int base = robot.group_index("base");
  Follower follower;
  follower.initialize(robot, stage.world.model, 1, kDt);
  follower.reset(stage.world);
  robots::RobotValues now;
  robot.read_qpos(stage.world, now);
  const auto at = [&](int i) { return now[base].values[i]; };
  // The same yaw, a full turn off.
  const double yaw = at(2) + 0.3 - 2 * std::numbers::pi;
  CommandPath path{base, {0, 4}, {at(0) - 0.1, at(1), yaw, at(0) - 1.3, at(1), yaw}};
  follower.plan(0).move_groups(1, {path}, 1.0);
  follower.begin(stage.world);
  std::array<double, 3> told{at(0), at(1), at(2)}, rate{};
  double maximum = 0, max_turn = 0;
  const auto look = [&](const robots::Action& action) {
    const robots::GroupValues& command = action.commands[base];
    for (int i = 0; i < 3; ++i) {
      const double next = command.given ? command.values[i] : told[i], v = (next - told[i]) / kDt;
      (i == 2 ? max_turn : maximum) =
          std::max(i == 2 ? max_turn : maximum, std::abs(v - rate[i]) / kDt);
      rate[i] = v;
      told[i] = next;
    }
  };
  for (int k = 0; k < 45; ++k) {
    robots::Action action;
    follower.follow(stage.world, action);
    look(action);
    stage.step(action);
  }
  EXPECT_NEAR(rate[0], -0.3, 1e-6) << "the command has caught up with the path";
  EXPECT_NEAR(told[2], at(2) + 0.3, 1e-9);
  for (bool stopped = false; !stopped;) {
    robots::Action action;
    stopped = follower.brake(stage.world, action);
    look(action);
    stage.step(action);
  }
  EXPECT_EQ(rate[0], 0);
  robots::Action held;
  EXPECT_TRUE(follower.brake(stage.world, held));
  EXPECT_FALSE(held.commands[base].given) << "a base holds without a command";
  const FollowerCfg cfg;
  EXPECT_LE(maximum, cfg.max_base_acceleration * (1 + 1e-9));
  EXPECT_LE(max_turn, cfg.max_base_turn_acceleration * (1 + 1e-9));
  EXPECT_GT(maximum, 0.5 * cfg.max_base_acceleration);
}

// The next path gives the same yaw, a full turn off.
TEST(Follower, ABaseDoesNotMakeAFullTurnBetweenPaths) {
  constexpr double kTurn = 2 * std::numbers::pi;
  TableStage stage("mobile_franka");
  const int base = stage.robot().group_index("base");
  Follower follower;
  follower.initialize(stage.robot(), stage.world.model, 1, 0.066);
  follower.reset(stage.world);
  robots::RobotValues now;
  stage.robot().read_qpos(stage.world, now);
  const auto at = now[base].values;
  const auto stay = [&](double yaw) {
    return CommandPath{base, {0, 1}, {at[0], at[1], yaw, at[0], at[1], yaw}};
  };
  Plan& plan = follower.plan(0);
  plan.move_groups(1, {stay(at[2])});
  plan.move_groups(1, {stay(at[2] - kTurn)});
  follower.begin(stage.world);
  while (!follower.finished(0)) {
    robots::Action action;
    follower.follow(stage.world, action);
    EXPECT_NEAR(action.commands[base].values[2], at[2], 1e-9);
    stage.step(action);
  }
}

// The end of a segment is commanded if it lies between two control steps.
TEST(Follower, AGroupReachesTheEndOfItsPath) {
  TableStage stage("franka");
  const int arm = stage.robot().arm();
  Follower follower;
  follower.initialize(stage.robot(), stage.world.model, 1);
  follower.restart(stage.world);
  const auto q = follower.joints(0)[arm].view();
  CommandPath path{arm, {0, 0.1}, {q.begin(), q.end()}};
  path.points.insert(path.points.end(), q.begin(), q.end());
  path.points.back() += 0.1;
  Plan& plan = follower.plan(0);
  plan.move_groups(1, {path});
  plan.wait(2, 0.2);
  follower.begin(stage.world);
  robots::Action action;
  for (int i = 0; i < 3; ++i) {
    action = {};
    follower.follow(stage.world, action);
    stage.step(action);
  }
  EXPECT_EQ(follower.phase(0), 2);
  EXPECT_EQ(action.commands[arm].values[6], path.points.back());
}

// The path begins 0.1 rad from the commanded arm position: the arm converges to it without a jump.
TEST(Follower, AnArmConvergesToAPathThatStartsElsewhere) {
  TableStage stage("franka");
  const int arm = stage.robot().arm();
  Follower follower;
  follower.initialize(stage.robot(), stage.world.model, 1);
  follower.restart(stage.world);
  const auto now = follower.joints(0)[arm].view();
  const std::vector<double> q(now.begin(), now.end());
  CommandPath here{arm, {0, 0.1}, q}, beside{arm, {0, 1.5}, q};
  here.points.insert(here.points.end(), q.begin(), q.end());
  beside.points[3] += 0.1;
  const std::vector<double> row = beside.points;
  beside.points.insert(beside.points.end(), row.begin(), row.end());
  follower.plan(0).move_groups(1, {here});
  follower.plan(0).move_groups(2, {beside});
  follower.begin(stage.world);
  double last = q[3];
  while (!follower.finished(0)) {
    robots::Action action;
    follower.follow(stage.world, action);
    EXPECT_LT(std::abs(action.commands[arm].values[3] - last), 0.012);
    last = action.commands[arm].values[3];
    stage.step(action);
  }
  EXPECT_EQ(last, row[3]);
}

TEST(Follower, AFloatingHandMovesItsToolToTheTarget) {
  TableStage stage("floating_rum");
  const robots::Robot& robot = stage.robot();
  Rng rng(0, 0, 0, 0);
  robot.write_start(robots::state_row(stage.world.data), Pose{{0.3, 0, 1.2}, {0, 1, 0, 0}}, rng);
  mj_forward(stage.world.model, stage.world.data);
  const auto hands = robots::hands_of(robot, stage.world.model);
  ASSERT_EQ(hands.size(), 1u);
  EXPECT_EQ(hands[0].tool, hands[0].gripper);
  Follower follower;
  follower.initialize(robot, stage.world.model, 1);
  follower.restart(stage.world);
  const Pose from = robot.leaf_pose(stage.world, hands[0].tool);
  const Pose to = moved(from, {0, 0.1, 0.1});
  follower.plan(0).move_tool_in_world(1, hands[0].tool, from, to, 0.2, 0.5);
  follower.begin(stage.world);
  while (!follower.finished(0)) {
    robots::Action action;
    follower.follow(stage.world, action);
    ASSERT_EQ(follower.failure(stage.world), PlanFailure::kNone);
    stage.step(action);
  }
  EXPECT_LT(norm(robot.leaf_pose(stage.world, hands[0].tool).p - to.p), 0.01);
}

// A planner of two stages; the second is planned from the end of the first. `bad_stage` gets no
// plan.
class TwoStages final : public TaskPlanner {
 public:
  explicit TwoStages(int bad_stage) : bad_stage_(bad_stage) {}
  std::vector<PlanRequest> requests;

 protected:
  void initialize_planner() override {}
  void make_plan(const World&, const PlanRequest& request, Plan& plan) override {
    requests.push_back(request);
    if (request.stage == bad_stage_) return;
    plan.wait(1 + request.stage, 0.1);
    plan.more = request.stage == 0;
  }

 private:
  int bad_stage_;
};

TEST(TaskPlanner, PlansTheNextStageAndEndsOnce) {
  TableStage stage("franka");
  TwoStages planner(-1);
  planner.initialize(*stage.task);
  planner.reset(stage.world);
  std::vector<int> phases;
  robots::Action action;
  for (int i = 0; i < 10 && !action.done; ++i) {
    planner.act(stage.world, action);
    phases.push_back(planner.phase(0));
    stage.step(action);
  }
  EXPECT_EQ(phases, (std::vector<int>{1, 1, 2, 2, 2}));
  EXPECT_FALSE(action.success.has_value());
  ASSERT_EQ(planner.requests.size(), 2u);
  EXPECT_EQ(planner.requests[1].stage, 1);
  EXPECT_EQ(planner.num_retries(0), 0);
}

TEST(TaskPlanner, StageWithoutAPlanIsRetriedThenGivenUp) {
  TableStage stage("franka");
  TwoStages planner(1);
  planner.initialize(*stage.task);
  planner.reset(stage.world);
  robots::Action action;
  for (int i = 0; i < 30 && !action.done; ++i) {
    planner.act(stage.world, action);
    stage.step(action);
  }
  EXPECT_EQ(action.success, std::optional<bool>(false));
  EXPECT_EQ(planner.num_retries(0), 3);
  EXPECT_EQ(planner.last_failure(0), PlanFailure::kUnplanned);
  EXPECT_EQ(planner.failure(0), "found no plan");
  EXPECT_EQ(planner.requests.size(), 8u);
}

// Closes the gripper on nothing, then finds no plan.
class ClosesOnce final : public TaskPlanner {
 protected:
  void initialize_planner() override {}
  void make_plan(const World&, const PlanRequest& request, Plan& plan) override {
    const int hand = robot().gripper();
    if (request.attempt == 0)
      plan.wait(1, 5).grip(hand, robot().groups()[hand].closed_command).holds(hand);
    plan.rejection = "nothing to close on";
  }
};

TEST(TaskPlanner, ReportsTheFailureAndThatTheRetryFoundNoPlan) {
  TableStage stage("franka");
  ClosesOnce planner;
  planner.initialize(*stage.task);
  planner.reset(stage.world);
  EXPECT_EQ(planner.failure(0), "");
  EXPECT_EQ(planner.grasp_pose(0).q.w, 1) << "the identity before the first grasp";
  robots::Action action;
  for (int i = 0; i < 60 && !action.done; ++i) {
    planner.act(stage.world, action);
    stage.step(action);
  }
  EXPECT_EQ(action.success, std::optional<bool>(false));
  EXPECT_EQ(planner.failure(0),
            "the hand held nothing, then it found no plan (nothing to close on)");
  planner.reset(stage.world);
  EXPECT_EQ(planner.failure(0), "") << "cleared by the next episode";
}

}  // namespace
}  // namespace mjsense::tasks::policies
