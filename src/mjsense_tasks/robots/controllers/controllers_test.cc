// SPDX-License-Identifier: Apache-2.0
// Tests of every kind of controller on a minimal robot.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense_tasks/robots/testing/lone_robot.h"

namespace mjsense::tasks::robots {
namespace {

using ::testing::HasSubstr;

// A robot with one move group "g"; policy, control and physics periods of 60, 6 and 2 ms.
struct OneGroup : LoneRobot {
  OneGroup(const std::string& xml, MoveGroupCfg group, const char* base = "base")
      : LoneRobot(of_group(xml, std::move(group), base)) {
    start();
  }
  static RobotCfg of_group(const std::string& xml, MoveGroupCfg group, const char* base) {
    RobotCfg cfg;
    cfg.name = "small";
    cfg.model.xml = xml;
    cfg.base_body = base;
    group.name = "g";
    cfg.groups = {std::move(group)};
    cfg.policy_dt_ms = 60;
    cfg.ctrl_dt_ms = 6;
    return cfg;
  }
  void play(std::vector<double> command, int steps = 1) {
    Action action;
    if (!command.empty()) action.commands[0].set(command);
    for (int s = 0; s < steps; ++s) LoneRobot::play(action);
  }
  double target(int i) const { return robot->targets(0)[0].values[i]; }
};

std::string two_joints(const char* actuator) {
  return std::string(R"(<mujoco><worldbody><body name="base"><geom size=".1" mass="1"/>
    <body name="a" pos="0 0 1"><joint name="a" axis="0 0 1" damping="1"/><geom size=".1" mass="1"/>
    <body name="b" pos="1 0 0"><joint name="b" type="slide" axis="1 0 0" damping="10"/><geom size=".1" mass="1"/>
    </body></body></body></worldbody><actuator>)") +
         actuator + "</actuator></mujoco>";
}

const std::string kPositions = two_joints(
    R"(<position name="a" joint="a" kp="1000" dampratio="1" ctrlrange="-2 2"/>
       <position name="b" joint="b" kp="4000" dampratio="1" ctrlrange="-2 2"/>)");

MoveGroupCfg group_of(ControllerCfg controller) {
  MoveGroupCfg group;
  group.joints = group.actuators = {"a", "b"};
  group.controller = std::move(controller);
  return group;
}

TEST(Controllers, PositionsAreTargets) {
  OneGroup r(kPositions, group_of(JointPositionCfg{}));
  EXPECT_FALSE(r.robot->controls_every_step());
  EXPECT_EQ(r.robot->groups()[0].command_unit, "m or rad");
  r.play({0.5, 3.0}, 30);
  EXPECT_EQ(r.target(0), 0.5);
  EXPECT_EQ(r.target(1), 2.0) << "clipped";
  EXPECT_NEAR(r.data->qpos[0], 0.5, 1e-3);
}

// A command has ten control steps; each covers a tenth of the path.
TEST(Controllers, PositionsMayBeRamped) {
  OneGroup r(kPositions, group_of(JointPositionCfg{.ramp = true}));
  EXPECT_TRUE(r.robot->controls_every_step());
  r.play({0.5, -0.5}, 1);
  EXPECT_EQ(r.target(0), 0.5);
  EXPECT_EQ(r.data->ctrl[0], 0.5) << "the ramp ends at the target";
  r.play({0.7, -0.5}, 1);
  EXPECT_EQ(r.data->ctrl[0], 0.7);
  r.play({0.0, -0.5}, 40);
  for (int k = 1; k < 30; ++k) r.play({0.03 * k, -0.5}, 1);
  EXPECT_NEAR(r.data->qvel[0], 0.03 / 0.06, 0.01) << "constant speed between commands";
  EXPECT_EQ(r.data->ctrl[1], -0.5);
}

TEST(Controllers, RelativePositionsAreMotions) {
  OneGroup r(kPositions, group_of(JointPositionRelativeCfg{0.01}));
  r.play({0.2, 0.1});
  EXPECT_NEAR(r.target(0), 0.2, 1e-12);
  const double q = r.data->qpos[0], kept = r.target(1);
  r.play({0.1, 0.001});
  EXPECT_NEAR(r.target(0), q + 0.1, 1e-12);
  EXPECT_EQ(r.target(1), kept) << "below the threshold the target does not change";
}

TEST(Controllers, VelocitiesMoveTheTargetsEvenly) {
  OneGroup r(kPositions, group_of(JointVelocityCfg{}));
  EXPECT_TRUE(r.robot->controls_every_step());
  EXPECT_EQ(r.robot->groups()[0].command_unit, "m or rad/s");
  r.play({0.5, -0.25}, 20);
  EXPECT_NEAR(r.target(0), 0.5 * 1.2, 1e-12);
  EXPECT_NEAR(r.target(1), -0.25 * 1.2, 1e-12);
  EXPECT_NEAR(r.data->qvel[0], 0.5, 0.02) << "constant speed between commands";
  r.play({}, 20);
  EXPECT_NEAR(r.data->qvel[0], 0, 1e-3);
}

TEST(Controllers, VelocityServosTakeVelocities) {
  OneGroup r(two_joints(R"(<velocity name="a" joint="a" kv="100" ctrlrange="-3 3"/>
                           <velocity name="b" joint="b" kv="100" ctrlrange="-3 3"/>)"),
             group_of(JointVelocityCfg{}));
  EXPECT_FALSE(r.robot->controls_every_step());
  EXPECT_EQ(r.robot->groups()[0].target_size, 0);
  r.play({0.5, 0.1}, 10);
  EXPECT_NEAR(r.data->qvel[0], 0.5, 0.02);
  r.play({}, 10);
  EXPECT_NEAR(r.data->qvel[0], 0.0, 0.01);
}

TEST(Controllers, OneHeightMovesTheJointsOfTheTorso) {
  OneGroup r(kPositions, group_of(TorsoHeightCfg{{0, 0.7}, {1, -2}}));
  ASSERT_EQ(r.robot->groups()[0].command_size, 1);
  r.play({0.5}, 30);
  EXPECT_EQ(r.target(0), 0.5);
  EXPECT_EQ(r.target(1), -1.0);
  EXPECT_NEAR(r.data->qpos[1], -1.0, 1e-3);
  r.play({9});
  EXPECT_EQ(r.target(0), 0.7);
}

// The command that commands() returns for a group without a command keeps the group's positions,
// also after rounding to float32.
void expect_kept(OneGroup& r) {
  const std::vector<double> before(r.data->qpos, r.data->qpos + r.model->nq);
  std::vector<double> command = r.robot->commands(r.world, {});
  for (double& x : command) x = static_cast<float>(x);
  r.play(command, 20);
  for (int i = 0; i < r.model->nq; ++i) EXPECT_NEAR(r.data->qpos[i], before[i], 1e-4) << i;
}

TEST(Controllers, KeepCommandsKeepAGroupAsItIs) {
  for (const ControllerCfg& kind :
       {ControllerCfg(JointPositionCfg{}), ControllerCfg(JointPositionRelativeCfg{}),
        ControllerCfg(JointVelocityCfg{}), ControllerCfg(TorsoHeightCfg{{0, 0.7}, {1, -2}})}) {
    MoveGroupCfg group = group_of(kind);
    group.init = {0.5, -0.3};  // not a multiple of the torso's ratio
    OneGroup r(kPositions, group);
    expect_kept(r);
  }
}

const std::string kPlanar = R"(<mujoco><worldbody><body name="base">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/><joint name="t" axis="0 0 1"/>
    <geom type="box" size=".2 .2 .1" mass="10" pos="0 0 .1"/></body></worldbody><actuator>
    <position name="x" joint="x" kp="20000" dampratio="1"/><position name="y" joint="y" kp="20000" dampratio="1"/>
    <position name="t" joint="t" kp="2000" dampratio="1"/></actuator></mujoco>)";

MoveGroupCfg planar(ControllerCfg controller) {
  MoveGroupCfg group;
  group.kind = GroupKind::kBase;
  group.joints = group.actuators = {"x", "y", "t"};
  group.controller = std::move(controller);
  return group;
}

TEST(Controllers, HolonomicBasesReachAPoseByTheShorterTurn) {
  OneGroup r(kPlanar, planar(HolonomicBaseCfg{}));
  r.start({{1, 2, 0}, axis_angle({0, 0, 1}, 3.0)});
  r.play({1.5, 1.8, -3.0}, 40);
  const Pose base = r.robot->base_pose(r.world);
  EXPECT_NEAR(base.p.x, 1.5, 1e-3);
  EXPECT_NEAR(base.p.y, 1.8, 1e-3);
  EXPECT_NEAR(r.data->qpos[2], 2 * std::numbers::pi - 3.0, 1e-3)
      << "the shorter turn passes through pi";
}

TEST(Controllers, DifferentialBasesMoveAlongTheirHeading) {
  OneGroup r(kPlanar, planar(DifferentialBaseCfg{}));
  EXPECT_EQ(r.robot->groups()[0].target_size, 0);
  r.start({{1, 0, 0}, axis_angle({0, 0, 1}, 0.5)});
  r.play({0.5, 0}, 20);  // 1.2 s
  r.play({}, 10);
  Pose base = r.robot->base_pose(r.world);
  EXPECT_NEAR(base.p.x, 1 + 0.6 * std::cos(0.5), 0.01);
  EXPECT_NEAR(base.p.y, 0.6 * std::sin(0.5), 0.01);
  // Half a circle with radius 1 m, 52 * 60 ms.
  r.start({});
  r.play({1.0, 1.0}, 52);
  r.play({}, 10);
  base = r.robot->base_pose(r.world);
  EXPECT_NEAR(base.p.x, std::sin(3.12), 0.06);
  EXPECT_NEAR(base.p.y, 1 - std::cos(3.12), 0.02);
}

TEST(Controllers, WheelSpeedsFollowFromTheCommand) {
  MoveGroupCfg group;
  group.kind = GroupKind::kBase;
  group.actuators = {"l", "r"};
  group.controller = DifferentialBaseCfg{1.0, 2.0, 0.1, 0.5};
  OneGroup r(
      R"(<mujoco><worldbody><body name="base"><freejoint/><geom type="box" size=".2 .2 .05" mass="5"/>
      <body name="l" pos="0 .25 0"><joint name="l" axis="0 1 0" damping=".1"/><geom type="cylinder" size=".1 .02" quat="1 1 0 0" mass="1"/></body>
      <body name="r" pos="0 -.25 0"><joint name="r" axis="0 1 0" damping=".1"/><geom type="cylinder" size=".1 .02" quat="1 1 0 0" mass="1"/></body>
      </body></worldbody><actuator><velocity name="l" joint="l" kv="1"/><velocity name="r" joint="r" kv="1"/></actuator></mujoco>)",
      group);
  r.play({0.5, 1.0});
  EXPECT_NEAR(r.data->ctrl[0], (0.5 - 0.25) / 0.1, 1e-12);
  EXPECT_NEAR(r.data->ctrl[1], (0.5 + 0.25) / 0.1, 1e-12);
}

TEST(Controllers, MocapBasesStayBelowTheirSpeedLimit) {
  MoveGroupCfg group;
  group.kind = GroupKind::kBase;
  group.controller = MocapBaseCfg{0.5, 1.0};
  OneGroup r(
      R"(<mujoco><worldbody><body name="base" mocap="true"><geom size=".1"/></body></worldbody></mujoco>)",
      group);
  r.play({1, 0, 0, 1, 0, 0, 0}, 10);  // 0.6 s
  EXPECT_NEAR(r.robot->base_pose(r.world).p.x, 0.3, 1e-9);
  r.play({1, 0, 0, 1, 0, 0, 0}, 30);
  EXPECT_EQ(r.robot->base_pose(r.world).p.x, 1.0);
  EXPECT_THAT(error_of<ValueError>([&] {
                r.play({1, 0, 0, 0, 0, 0, 0});
              }),
              HasSubstr("is not a rotation"));
}

TEST(Controllers, ErrorsNameTheRequirements) {
  const auto fault = [](const std::string& xml, MoveGroupCfg group) -> std::string {
    try {
      OneGroup r(xml, std::move(group));
      return "no error";
    } catch (const Error& e) {
      return e.what();
    }
  };
  EXPECT_THAT(fault(kPositions, group_of(HolonomicBaseCfg{})),
              HasSubstr("robot 'small', move group 'g': the controller 'holonomic_base' needs 3 "
                        "actuators; the group has 2"));
  EXPECT_THAT(fault(two_joints(R"(<motor name="a" joint="a"/><motor name="b" joint="b"/>)"),
                    group_of(JointPositionRelativeCfg{})),
              HasSubstr("needs position servos of joints; the actuator 'robot_0/a' is not one"));
  MoveGroupCfg mocap;
  mocap.kind = GroupKind::kBase;
  mocap.controller = MocapBaseCfg{};
  EXPECT_THAT(fault(kPositions, mocap), HasSubstr("the base 'robot_0/base' is not one"));
  mocap.controller = FreeBaseCfg{"target"};
  EXPECT_THAT(fault(kPositions, mocap), HasSubstr("needs a free joint"));
}

// A base that nothing can move: its present pose is accepted, any other pose is an error that says
// how to make it movable.
TEST(Bases, FixedBaseCannotBePlacedElsewhere) {
  RobotCfg cfg;
  cfg.name = "small";
  cfg.base_body = "base";
  cfg.model.xml = kPositions;
  scene::SceneCfg scene_cfg;
  scene::EntityCfg entity;
  entity.model = cfg.model;
  entity.mocap_base = false;
  entity.pos = {1, 2, 3};
  scene_cfg.entities = {{"robot_0", entity}};
  const scene::Scene scene(scene_cfg);
  const DataPtr data = make_data(scene.model());
  const Robot robot(cfg, scene.model(), 1);
  Rng rng(1, 0, 0, 0);
  robot.write_start(state_row(data.get()), Pose{{1, 2, 3}, {}}, rng);
  try {
    robot.write_start(state_row(data.get()), Pose{{1, 2, 2}, {}}, rng);
    FAIL();
  } catch (const ValueError& e) {
    EXPECT_THAT(e.what(), HasSubstr("the base 'robot_0/base' cannot be placed at (1, 2, 2)"));
    EXPECT_THAT(e.what(), HasSubstr("mocap_base"));
  }
}

// A planar arm of two links of 1 m in the xy plane, and a wrist; the tool is at the wrist.
MoveGroupCfg planar_arm(ControllerCfg controller) {
  MoveGroupCfg group;
  group.kind = GroupKind::kArm;
  group.joints = group.actuators = {"shoulder", "elbow", "wrist"};
  group.leaf_site = "tool";
  group.init = {0.3, 1.2, 0.5};
  group.controller = std::move(controller);
  return group;
}

const std::string kPlanarArm = R"(<mujoco><option gravity="0 0 0"/><default>
  <position kp="1000" dampratio="1" ctrlrange="-3 3"/><joint axis="0 0 1" armature="0.1"/></default>
  <worldbody><body name="base"><geom size=".1" mass="1"/>
    <body><joint name="shoulder"/><geom size=".1" mass="1"/>
    <body pos="1 0 0"><joint name="elbow"/><geom size=".1" mass="1"/>
    <body pos="1 0 0"><joint name="wrist"/><geom size=".1" mass=".1"/><site name="tool"/>
    </body></body></body></body></worldbody><actuator><position name="shoulder" joint="shoulder"/>
    <position name="elbow" joint="elbow"/><position name="wrist" joint="wrist"/></actuator></mujoco>)";

Pose tool_of(const OneGroup& r) { return r.robot->tcp_pose(r.world, 0); }

TEST(Controllers, DisplacementsOfTheToolAreInTheChosenFrame) {
  for (const DeltaFrame frame : {DeltaFrame::kBase, DeltaFrame::kTool}) {
    OneGroup r(kPlanarArm, planar_arm(EeDeltaPoseCfg{.frame = frame}));
    EXPECT_EQ(r.robot->groups()[0].command_size, 6);
    const Pose from = tool_of(r);
    r.play({0.02, 0.01, 0, 0, 0, 0.1});
    r.play({0, 0, 0, 0, 0, 0}, 30);
    const Vec3 moved{0.02, 0.01, 0};
    const Vec3 expected = from.p + (frame == DeltaFrame::kBase ? moved : rotate(from.q, moved));
    const Pose target = r.robot->target_pose(r.world, 0);
    EXPECT_LT(norm(target.p - expected), 1e-6);
    EXPECT_NEAR(log3(target.q * conjugate(from.q)).z, 0.1, 1e-6);
    EXPECT_LT(norm(tool_of(r).p - expected), 1e-3);
  }
}

TEST(Controllers, DisplacementsOfTheToolAreLimited) {
  OneGroup r(kPlanarArm, planar_arm(EeDeltaPoseCfg{.max_translation = 0.02}));
  const Pose from = tool_of(r);
  r.play({0, 1, 0, 0, 0, 0});
  r.play({0, 0, 0, 0, 0, 0}, 30);
  EXPECT_NEAR(tool_of(r).p.y - from.p.y, 0.02, 1e-3);
}

// The target moves with 0.5 m/s: 0.03 m in one step of 60 ms.
TEST(Controllers, PosesOfTheToolAreApproachedAtLimitedSpeed) {
  OneGroup r(kPlanarArm, planar_arm(EePoseCfg{}));
  const Pose from = tool_of(r);
  std::vector<double> command(7);
  write_pose(Pose{from.p + Vec3{0, 0.12, 0}, from.q}, command.data());
  r.play(command);
  EXPECT_NEAR(r.robot->target_pose(r.world, 0).p.y - from.p.y, 0.03, 1e-6);
  r.play(command, 30);
  EXPECT_NEAR(tool_of(r).p.y - from.p.y, 0.12, 1e-3);
  EXPECT_THAT(
      [&] {
        r.play({0, 0, 0, 0, 0, 0, 0});
      },
      ThrowsMessage<ValueError>(HasSubstr("is not a rotation")));
}

// A pose that is out of reach stretches the arm; the joints' targets stay finite and slow.
TEST(Controllers, PosesOutOfReachAreApproached) {
  OneGroup r(kPlanarArm, planar_arm(EePoseCfg{}));
  double last[3] = {r.target(0), r.target(1), r.target(2)};
  for (int step = 0; step < 200; ++step) {
    r.play({3, 0, 0.5, 1, 0, 0, 0});
    for (int i = 0; i < 3; ++i) {
      EXPECT_LE(std::abs(r.target(i) - last[i]), 0.12 + 1e-9);
      last[i] = r.target(i);
    }
  }
  EXPECT_GT(tool_of(r).p.x, 1.9);
}

TEST(Controllers, ToolControllersNeedATool) {
  MoveGroupCfg group = planar_arm(EePoseCfg{});
  group.leaf_site.clear();
  EXPECT_THAT([&] { OneGroup(kPlanarArm, group); },
              ThrowsMessage<ValueError>(HasSubstr("needs leaf_site")));
  EXPECT_THAT([] { parse_controller("ee_delta_pos", "arm_controller"); },
              ThrowsMessage<ValueError>(HasSubstr("did you mean 'ee_delta_pose'")));
  const ControllerCfg parsed = parse_controller("{ kind = 'ee_delta_pose', frame = 'tool' }", "x");
  EXPECT_EQ(std::get<EeDeltaPoseCfg>(parsed).frame, DeltaFrame::kTool);
}

}  // namespace
}  // namespace mjsense::tasks::robots
