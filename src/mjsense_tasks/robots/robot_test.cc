// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/robot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/scene/scene.h"
#include "mjsense_tasks/robots/load_robot.h"

namespace mjsense::tasks::robots {
namespace {

using ::testing::HasSubstr;

// A Franka without other objects, in two worlds.
struct Franka : ::testing::Test {
  static scene::SceneCfg scene_cfg() {
    scene::SceneCfg cfg;
    scene::EntityCfg entity;
    entity.model = robot_cfg("franka").model;
    cfg.entities = {{"robot_0", entity}};
    return cfg;
  }
  void SetUp() override {
    for (int w = 0; w < 2; ++w) {
      data[w].reset(mj_makeData(model));
      worlds[w] = {.id = w, .model = model, .data = data[w].get()};
      Rng rng(7, 0, 0, w);
      robot.write_start(state_row(data[w].get()), {}, rng);
      mj_forward(model, data[w].get());
      robot.reset(worlds[w]);
    }
  }
  void step(int w, int substeps) {
    robot.write_ctrl(worlds[w], state_row(data[w].get()), nullptr);
    for (int i = 0; i < substeps; ++i) mj_step(model, data[w].get());
    mj_forward(model, data[w].get());
  }
  std::vector<double> arm_qpos(int w) const {
    RobotValues q;
    robot.read_qpos(worlds[w], q);
    const auto arm = q[robot.arm()].view();
    return {arm.begin(), arm.end()};
  }

  scene::Scene scene{scene_cfg()};
  const mjModel* model = scene.model();
  Robot robot{robot_cfg("franka"), model, 2};
  DataPtr data[2];
  World worlds[2];
};

TEST_F(Franka, HasThreeMoveGroups) {
  ASSERT_EQ(robot.groups().size(), 3u);
  EXPECT_EQ(robot.groups()[0].name, "base");
  EXPECT_FALSE(robot.groups()[0].controlled());
  EXPECT_EQ(robot.group("arm").joints.size(), 7u);
  EXPECT_EQ(robot.group("gripper").joints.size(), 2u);
  EXPECT_EQ(robot.group("gripper").actuators.size(), 1u);
  EXPECT_EQ(robot.group("gripper").ctrl_high[0], 255);
  EXPECT_NEAR(robot.group("arm").ctrl_low[3], -3.0770, 1e-12);
}

TEST_F(Franka, StartsNearItsStartConfigurationAndStaysThere) {
  const double init[] = {0, -0.7853, 0, -2.35619, 0, 1.57079, 0};
  const double spread[] = {0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.175};
  const auto before = arm_qpos(0);
  for (int i = 0; i < 7; ++i) EXPECT_LE(std::abs(before[i] - init[i]), spread[i]);
  EXPECT_NE(before, arm_qpos(1));  // each world draws its own noise
  step(0, 1000);
  const auto after = arm_qpos(0);
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(after[i], before[i], 1e-6);
}

// Start positions are clipped to the joint limits.
TEST_F(Franka, StartsAreClippedToTheLimits) {
  RobotCfg cfg = robot_cfg("franka");
  MoveGroupCfg& arm = cfg.groups[1];
  double low[7], high[7];
  for (int i = 0; i < 7; ++i) {
    const int joint = robot.groups()[1].joints[i];
    ASSERT_TRUE(model->jnt_limited[joint]);
    low[i] = model->jnt_range[2 * joint];
    high[i] = model->jnt_range[2 * joint + 1];
    arm.init[i] = i % 2 ? low[i] + 0.02 : high[i] - 0.02;
    arm.spread[i] = 0.1;
  }
  const Robot near(cfg, model, 1);
  int at_limit[7] = {}, inside[7] = {};
  for (int k = 0; k < 200; ++k) {
    Rng rng(3, 0, 0, k);
    for (int i = 0; i < model->nv; ++i) data[0]->qvel[i] = 1;
    near.write_start(state_row(data[0].get()), {}, rng);
    for (int i = 0; i < 7; ++i) {
      const double q = data[0]->qpos[near.groups()[1].qpos[i]];
      EXPECT_GE(q, low[i]);
      EXPECT_LE(q, high[i]);
      EXPECT_EQ(data[0]->qvel[near.groups()[1].dofs[i]], 0) << "it starts at rest";
      EXPECT_EQ(data[0]->ctrl[near.groups()[1].actuators[i]], q)
          << "its target is the start position";
      ++(q == low[i] || q == high[i] ? at_limit : inside)[i];
    }
  }
  for (int i = 0; i < 7; ++i) {  // the probability of a draw beyond the limit is 0.4
    EXPECT_NEAR(at_limit[i], 80, 35) << i;
    EXPECT_NEAR(inside[i], 120, 35) << i;
  }
}

// The noise of each joint covers its own width on both sides.
TEST_F(Franka, StartNoiseHasItsWidth) {
  const double init[] = {0, -0.7853, 0, -2.35619, 0, 1.57079, 0};
  const double spread[] = {0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.175};
  double minimum[7] = {}, maximum[7] = {};
  for (int k = 0; k < 400; ++k) {
    Rng rng(9, 0, 0, k);
    robot.write_start(state_row(data[0].get()), {}, rng);
    const auto q = arm_qpos(0);
    for (int i = 0; i < 7; ++i) {
      minimum[i] = std::min(minimum[i], (q[i] - init[i]) / spread[i]);
      maximum[i] = std::max(maximum[i], (q[i] - init[i]) / spread[i]);
    }
  }
  for (int i = 0; i < 7; ++i) {
    EXPECT_NEAR(minimum[i], -1, 0.03) << i;
    EXPECT_NEAR(maximum[i], 1, 0.03) << i;
  }
}

TEST_F(Franka, StartsWhereItsBaseIsPut) {
  Rng rng(1, 0, 0, 0);
  const Pose base{{0.3, -0.2, 0.1}, axis_angle({0, 0, 1}, 1.1)};
  robot.write_start(state_row(data[1].get()), base, rng);
  mj_forward(model, data[1].get());
  const Pose seen = robot.base_pose(worlds[1]);
  EXPECT_LT(norm(seen.p - base.p), 1e-12);
  EXPECT_LT(angle_between(seen.q, base.q), 1e-7);
}

TEST_F(Franka, ToolPoseIsForwardKinematicsInTheBaseFrame) {
  RobotValues q;
  robot.read_qpos(worlds[0], q);
  const Pose measured = robot.tcp_pose(worlds[0], robot.gripper());
  for (int group : {robot.arm(), robot.gripper()}) {
    const Pose computed = robot.fk(group, q);
    EXPECT_LT(norm(measured.p - computed.p), 1e-12);
    EXPECT_LT(angle_between(measured.q, computed.q), 1e-7);
  }
  EXPECT_GT(measured.p.z, 0.58);  // the base frame is on the floor
  EXPECT_EQ(norm(robot.fk(0, q).p), 0);

  // The tool pose in the base frame does not depend on the base placement.
  data[0]->mocap_pos[0] = 1.5;
  write_quat(axis_angle({0, 0, 1}, 0.7), data[0]->mocap_quat);
  mj_forward(model, data[0].get());
  EXPECT_NEAR(robot.base_pose(worlds[0]).p.x, 1.5, 1e-12);
  EXPECT_LT(norm(robot.tcp_pose(worlds[0], robot.arm()).p - measured.p), 1e-12);
}

TEST_F(Franka, GripperOpensAndClosesOnCommand) {
  const int g = robot.gripper();
  EXPECT_NEAR(robot.opening(worlds[0], g), 0.087, 0.001);
  EXPECT_TRUE(robot.is_open(worlds[0], g));
  Action action;
  const double closed = 255;
  action.commands[g].set({&closed, 1});
  robot.command(worlds[0], action);
  step(0, 500);
  EXPECT_NEAR(robot.opening(worlds[0], g), 0.0, 0.001);
  EXPECT_FALSE(robot.is_open(worlds[0], g));
  EXPECT_NEAR(data[0]->qpos[robot.groups()[g].qpos[0]], 0.8, 0.005);
  // Without a command the gripper holds its state: closed.
  robot.command(worlds[0], {});
  EXPECT_EQ(robot.targets(0)[g].values[0], 255);
  const double open = 0;
  action.commands[g].set({&open, 1});
  robot.command(worlds[0], action);
  step(0, 500);
  EXPECT_NEAR(robot.opening(worlds[0], g), 0.087, 0.001);
}

TEST_F(Franka, GroupsWithoutACommandHold) {
  Action action;
  auto target = arm_qpos(0);
  target[0] += 0.3;
  action.commands[robot.arm()].set(target);
  robot.command(worlds[0], action);
  step(0, 33);
  robot.command(worlds[0], {});
  const auto held = arm_qpos(0);
  const auto first = robot.targets(0)[robot.arm()].view();
  EXPECT_EQ(std::vector<double>(first.begin(), first.end()), held);
  // The target is set once: the arm still moves, but the target does not follow it.
  step(0, 33);
  robot.command(worlds[0], {});
  const auto second = robot.targets(0)[robot.arm()].view();
  EXPECT_EQ(std::vector<double>(second.begin(), second.end()), held);
  EXPECT_NE(arm_qpos(0), held);
  // The other world's targets are unchanged.
  EXPECT_FALSE(robot.targets(1)[robot.arm()].given);
}

TEST_F(Franka, CommandsAreClippedAndChecked) {
  Action action;
  std::vector<double> target(7, 10.0);
  action.commands[robot.arm()].set(target);
  robot.command(worlds[0], action);
  const auto clipped = robot.targets(0)[robot.arm()].view();
  for (int i = 0; i < 7; ++i) EXPECT_EQ(clipped[i], robot.group("arm").ctrl_high[i]);

  target.pop_back();
  action.commands[robot.arm()].set(target);
  EXPECT_THAT(error_of<ValueError>([&] { robot.command(worlds[0], action); }),
              HasSubstr("move group 'arm' takes 7 commands, but the action has 6"));
  target.assign(7, NAN);
  action.commands[robot.arm()].set(target);
  EXPECT_THROW(robot.command(worlds[0], action), ValueError);
}

TEST_F(Franka, ActionNoiseGrowsWithTheMotionAndIsNotRecorded) {
  const StateRow state = state_row(data[0].get());
  const auto start = arm_qpos(0);
  const int arm = robot.arm();
  Rng rng(1, 0, 0, 0);
  robot.write_ctrl(worlds[0], state, &rng);
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(state.ctrl[i], start[i], 1e-12) << "no motion, no noise";

  Action action;
  auto target = start;
  target[0] += 0.1;
  action.commands[arm].set(target);
  robot.command(worlds[0], action);
  RobotValues values;
  robot.read_qpos(worlds[0], values);
  const Pose here = robot.fk(arm, values);
  // The tool would move by 0.1 rad about the first joint's axis.
  const double move = 0.1 * std::hypot(here.p.x, here.p.y);
  const Pose wanted = robot.fk(arm, robot.targets(0));
  double square = 0, turned = 0;
  const int draws = 2000;
  for (int k = 0; k < draws; ++k) {
    robot.write_ctrl(worlds[0], state, &rng);
    values[arm].set({state.ctrl, 7});
    const Pose disturbed = robot.fk(arm, values);
    const Vec3 off = disturbed.p - wanted.p;
    const double angle = angle_between(disturbed.q, wanted.q);
    turned += angle * angle;
    for (int i = 0; i < 3; ++i)
      EXPECT_LT(std::abs(off[i]), 0.023);  // 0.02 and the error of the linearisation
    square += dot(off, off);
  }
  EXPECT_NEAR(std::sqrt(square / (3 * draws)), 0.1 * move, 0.01 * move);
  EXPECT_NEAR(std::sqrt(turned / (3 * draws)), 0.01 * move,
              0.001 * move);  // rad: a tenth of the metres
  EXPECT_EQ(robot.targets(0)[arm].values[0], target[0]);
}

// Untruncated, this motion of 0.25 m would get noise with a standard deviation of 0.025 m.
TEST_F(Franka, ActionNoiseIsTruncated) {
  const StateRow state = state_row(data[0].get());
  const int arm = robot.arm();
  Action action;
  auto target = arm_qpos(0);
  target[0] += 0.6;
  action.commands[arm].set(target);
  robot.command(worlds[0], action);
  const Pose wanted = robot.fk(arm, robot.targets(0));
  RobotValues values;
  robot.read_qpos(worlds[0], values);
  Rng rng(1, 0, 0, 0);
  double farthest = 0;
  for (int k = 0; k < 500; ++k) {
    robot.write_ctrl(worlds[0], state, &rng);
    values[arm].set({state.ctrl, 7});
    farthest = std::max(farthest, norm(robot.fk(arm, values).p - wanted.p));
  }
  // Distance to the corner of a cube with edges of 2 x 0.02 m, plus the error of the linearisation.
  EXPECT_LT(farthest, 1.1 * std::sqrt(3.0) * 0.02);
  EXPECT_GT(farthest, 0.025);
}

// With the arm stretched out, an undamped displacement of the tool by millimetres would move joints
// by radians.
TEST_F(Franka, ActionNoiseIsBoundedAtSingularPostures) {
  const StateRow state = state_row(data[0].get());
  const int arm = robot.arm();
  const double stretched[] = {0, 0, 0, -0.1169, 0, 0.44, 0};
  for (int i = 0; i < 7; ++i) state.qpos[robot.groups()[arm].qpos[i]] = stretched[i];
  mj_forward(model, data[0].get());
  Action action;
  std::vector<double> target(stretched, stretched + 7);
  target[1] += 0.1;
  action.commands[arm].set(target);
  robot.command(worlds[0], action);
  Rng rng(1, 0, 0, 0);
  double farthest = 0;
  for (int k = 0; k < 500; ++k) {
    robot.write_ctrl(worlds[0], state, &rng);
    for (int i = 0; i < 7; ++i) farthest = std::max(farthest, std::abs(state.ctrl[i] - target[i]));
  }
  EXPECT_LE(farthest, robot.cfg().noise.max_joint + 1e-12);
  EXPECT_GT(farthest, 0.01);
}

TEST_F(Franka, UnknownNamesAreErrorsWithASuggestion) {
  EXPECT_THAT(error_of<KeyError>([&] { robot.group_index("griper"); }), HasSubstr("'gripper'"));
  RobotCfg wrong = robot_cfg("franka");
  wrong.groups[1].joints[2] = "fr3_jont3";
  try {
    Robot broken(wrong, model, 1);
    FAIL();
  } catch (const KeyError& e) {
    EXPECT_THAT(e.what(), HasSubstr("robot 'franka'"));
    EXPECT_THAT(e.what(), HasSubstr("robot_0/fr3_joint3"));
  }
}

}  // namespace
}  // namespace mjsense::tasks::robots
