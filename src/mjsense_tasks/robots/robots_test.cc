// SPDX-License-Identifier: Apache-2.0
// Properties of every built-in robot: kinematics agree with MuJoCo, controllers reach their
// targets, and the base can be placed anywhere.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense_tasks/robots/load_robot.h"
#include "mjsense_tasks/robots/testing/lone_robot.h"

namespace mjsense::tasks::robots {
namespace {

using ::testing::HasSubstr;

struct Alone : LoneRobot {
  explicit Alone(const std::string& name, const std::optional<ControllerCfg>& of_arms = {})
      : LoneRobot(with_controller(robot_cfg(name), of_arms)) {}
  static RobotCfg with_controller(RobotCfg cfg, const std::optional<ControllerCfg>& of_arms) {
    for (MoveGroupCfg& group : cfg.groups)
      if (of_arms && group.kind == GroupKind::kArm) group.controller = *of_arms;
    return cfg;
  }
  using LoneRobot::play;
  void play(const Action& action, double seconds) {
    for (double t = 0; t < seconds; t += 0.001 * cfg.policy_dt_ms) play(action);
  }
  int find(GroupKind kind) const {
    for (std::size_t g = 0; g < robot->groups().size(); ++g)
      if (robot->groups()[g].kind == kind) return static_cast<int>(g);
    return -1;
  }
};

Pose anywhere(Rng& rng) {
  const Vec3 axis = normalized(Vec3{rng.normal(), rng.normal(), rng.normal()});
  return {{rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(-1, 1)},
          axis_angle(axis, rng.uniform(0, 3.0))};
}

Pose on_the_floor(Rng& rng) {
  return {{rng.uniform(-3, 3), rng.uniform(-3, 3), 0},
          axis_angle({0, 0, 1}, rng.uniform(-std::numbers::pi, std::numbers::pi))};
}

void expect_same(const Pose& a, const Pose& b, double tolerance, const char* what) {
  EXPECT_LT(norm(a.p - b.p), tolerance) << what;
  // The vector part of the quaternion: an angle from the arc cosine has only half the digits.
  const Quat d = conjugate(a.q) * b.q;
  EXPECT_LT(std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z), tolerance) << what;
}

// Sets the joints of all groups but the base to random positions within their ranges.
void randomize(const Robot& robot, const mjModel* m, mjData* d, Rng& rng) {
  for (const MoveGroup& group : robot.groups()) {
    if (group.kind == GroupKind::kBase) continue;
    for (std::size_t i = 0; i < group.joints.size(); ++i) {
      const int j = group.joints[i];
      const double low = m->jnt_limited[j] ? m->jnt_range[2 * j] : -std::numbers::pi;
      const double high = m->jnt_limited[j] ? m->jnt_range[2 * j + 1] : std::numbers::pi;
      d->qpos[m->jnt_qposadr[j]] = rng.uniform(low, high);
    }
  }
}

struct EveryRobot : ::testing::TestWithParam<std::string> {
  Alone alone{GetParam()};
};

TEST_P(EveryRobot, TheFirstArmAndGripperAreTheDefault) {
  EXPECT_EQ(alone.robot->arm(), alone.find(GroupKind::kArm));
  EXPECT_EQ(alone.robot->gripper(), alone.find(GroupKind::kGripper));
}

// Each value of a command has a range.
TEST_P(EveryRobot, CommandsHaveRanges) {
  for (const MoveGroup& group : alone.robot->groups()) {
    const auto size = static_cast<std::size_t>(group.command_size);
    EXPECT_EQ(group.command_low.size(), size) << group.name;
    EXPECT_EQ(group.command_high.size(), size) << group.name;
    for (std::size_t i = 0; i < std::min(size, group.command_high.size()); ++i)
      EXPECT_LT(group.command_low[i], group.command_high[i]) << group.name << " " << i;
  }
}

TEST_P(EveryRobot, TheBaseCanBePlacedAnywhere) {
  Rng rng(1, 0, 0, 0);
  for (int k = 0; k < 20; ++k) {
    const Pose base = k < 10 ? on_the_floor(rng) : anywhere(rng);
    alone.start(base, k);
    expect_same(alone.robot->base_pose(alone.world), base, 1e-12, "base");
  }
}

TEST_P(EveryRobot, ForwardKinematicsAgreeWithMuJoCo) {
  const Robot& robot = *alone.robot;
  Rng rng(2, 0, 0, 0);
  for (int k = 0; k < 100; ++k) {
    alone.start(anywhere(rng), k);
    randomize(robot, alone.model, alone.data.get(), rng);
    mj_kinematics(alone.model, alone.data.get());
    RobotValues q;
    robot.read_qpos(alone.world, q);
    for (std::size_t g = 0; g < robot.groups().size(); ++g) {
      const int group = static_cast<int>(g);
      expect_same(robot.fk(group, q), robot.tcp_pose(alone.world, group), 1e-12,
                  robot.groups()[g].name.c_str());
    }
  }
}

// Targets are the leaf poses of random configurations of the arm; the other groups stay at their
// start positions.
TEST_P(EveryRobot, InverseKinematicsReachesReachablePoses) {
  const Robot& robot = *alone.robot;
  alone.start();
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const MoveGroup& group = robot.groups()[g];
    if (group.kind != GroupKind::kArm) continue;
    RobotValues start;
    robot.read_qpos(alone.world, start);
    Rng rng(3, 0, 0, 0);
    int solved = 0;
    constexpr int kPoses = 1000;
    for (int k = 0; k < kPoses; ++k) {
      RobotValues goal = start, q = start;
      for (std::size_t i = 0; i < group.joints.size(); ++i) {
        const double* range = alone.model->jnt_range + 2 * group.joints[i];
        goal[static_cast<int>(g)].values[i] = rng.uniform(range[0], range[1]);
      }
      const int index = static_cast<int>(g);
      const Pose target = robot.fk(index, goal);
      if (!robot.ik(index, target, q)) continue;
      const Pose reached = robot.fk(index, q);
      EXPECT_LT(norm(reached.p - target.p), 1e-4);
      EXPECT_LT(angle_between(reached.q, target.q), 1e-4);
      for (std::size_t other = 0; other < robot.groups().size(); ++other) {
        if (other == g) continue;
        EXPECT_EQ(q[static_cast<int>(other)].values, start[static_cast<int>(other)].values);
      }
      ++solved;
    }
    EXPECT_GE(solved, 990) << group.name;
  }
}

TEST_P(EveryRobot, WithoutACommandItStaysWhereItStarts) {
  Rng rng(4, 0, 0, 0);
  alone.start(on_the_floor(rng));
  const Robot& robot = *alone.robot;
  RobotValues before, after;
  robot.read_qpos(alone.world, before);
  const Pose base = robot.base_pose(alone.world);
  alone.play({}, 2.0);
  robot.read_qpos(alone.world, after);
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    for (int i = 0; i < before[static_cast<int>(g)].size; ++i) {
      EXPECT_NEAR(after[static_cast<int>(g)].values[i], before[static_cast<int>(g)].values[i], 0.02)
          << robot.groups()[g].name << " " << i;
    }
  }
  expect_same(robot.base_pose(alone.world), base, 2e-3, "base");
}

TEST_P(EveryRobot, ArmsReachTheirTargets) {
  const Robot& robot = *alone.robot;
  Rng rng(5, 0, 0, 0);
  alone.start(on_the_floor(rng));
  RobotValues now;
  robot.read_qpos(alone.world, now);
  Action action;
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const MoveGroup& group = robot.groups()[g];
    if (group.kind != GroupKind::kArm) continue;
    std::vector<double> target;
    for (int i = 0; i < group.command_size; ++i) {
      const double q = now[static_cast<int>(g)].values[i];
      target.push_back(std::clamp(q + rng.uniform(-0.3, 0.3), group.ctrl_low[i] + 0.02,
                                  group.ctrl_high[i] - 0.02));
    }
    action.commands[static_cast<int>(g)].set(target);
  }
  alone.play(action, 3.0);
  robot.read_qpos(alone.world, now);
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const GroupValues& told = action.commands[static_cast<int>(g)];
    for (int i = 0; told.given && i < told.size; ++i) {
      EXPECT_NEAR(now[static_cast<int>(g)].values[i], told.values[i], 0.02)
          << robot.groups()[g].name << " " << i;
      EXPECT_EQ(robot.targets(0)[static_cast<int>(g)].values[i], told.values[i]);
    }
  }
}

// The tool is displaced by what the table [noise] says: joints of other groups that carry the arm,
// such as a torso, take no part of the displacement.
TEST_P(EveryRobot, ActionNoiseOfArmsIsAsLargeAsConfigured) {
  RobotCfg cfg = alone.cfg;
  cfg.noise.scale = 0.1;
  cfg.noise.max_joint = 1;
  Robot robot(cfg, alone.model, 1);
  alone.start();
  const StateRow state = state_row(alone.data.get());
  Rng rng(8, 0, 0, 0);
  for (int g = 0; g < static_cast<int>(robot.groups().size()); ++g) {
    const MoveGroup& group = robot.groups()[g];
    if (group.kind != GroupKind::kArm || !group.targets_are_qpos()) continue;
    double square = 0, expected = 0;
    for (int posture = 0; posture < 50; ++posture) {
      RobotValues values;
      std::vector<double> target;
      for (std::size_t i = 0; i < group.joints.size(); ++i) {
        const double* range = alone.model->jnt_range + 2 * group.joints[i];
        const double q = range[0] + rng.uniform(0.25, 0.75) * (range[1] - range[0]);
        alone.data->qpos[group.qpos[i]] = q;
        target.push_back(q + rng.uniform(-0.05, 0.05));
      }
      robot.read_qpos(alone.world, values);
      const Pose from = robot.fk(g, values);
      Action action;
      action.commands[g].set(target);
      robot.reset(alone.world);
      robot.command(alone.world, action);
      values[g].set(target);
      const Pose to = robot.fk(g, values);
      for (int draw = 0; draw < 40; ++draw) {
        robot.write_ctrl(alone.world, state, &rng);
        robot.control(alone.world, cfg.policy_dt_ms / cfg.ctrl_dt_ms - 1);  // the end of a ramp
        for (std::size_t i = 0; i < target.size(); ++i)
          values[g].values[i] = state.ctrl[group.actuators[i]];
        const Vec3 off = robot.fk(g, values).p - to.p;
        square += dot(off, off) / 3;
        expected += 0.01 * dot(to.p - from.p, to.p - from.p);
      }
    }
    EXPECT_NEAR(std::sqrt(square / expected), 1, 0.1) << group.name;
  }
}

// Moves every arm's tool 10 cm in several directions and turns it by 0.2 rad, with poses and with
// displacements as commands.
TEST_P(EveryRobot, ToolsReachCommandedPoses) {
  for (const ControllerCfg& controller :
       std::initializer_list<ControllerCfg>{EePoseCfg{}, EeDeltaPoseCfg{}}) {
    const bool absolute = std::holds_alternative<EePoseCfg>(controller);
    Alone of(GetParam(), controller);
    const Robot& robot = *of.robot;
    for (int g = 0; g < static_cast<int>(robot.groups().size()); ++g) {
      const MoveGroup& group = robot.groups()[g];
      if (group.kind != GroupKind::kArm) continue;
      int reachable = 0;
      for (const Vec3 to : {Vec3{0.1, 0, 0}, Vec3{-0.1, 0, 0}, Vec3{0, 0.1, 0}, Vec3{0, -0.1, 0},
                            Vec3{0, 0, 0.1}, Vec3{0, 0, -0.1}}) {
        of.start();
        const Pose from = robot.tcp_pose(of.world, g);
        const Pose goal{from.p + to, normalized(exp3({0, 0, 0.2}) * from.q)};
        RobotValues values;
        robot.read_qpos(of.world, values);
        if (!robot.ik(g, goal, values, Chain::kTracking)) continue;
        ++reachable;
        std::vector<double> command(7);
        write_pose(goal, command.data());
        if (!absolute) command = {to.x / 4, to.y / 4, to.z / 4, 0, 0, 0.2 / 4};
        Action action;
        action.commands[g].set(command);
        for (int step = 0; step < 30; ++step) {
          if (!absolute && step == 4) action.commands[g].set(std::vector<double>(6, 0.0));
          of.play(action);
          for (std::size_t i = 0; i < group.joints.size(); ++i) {
            const double* range = of.model->jnt_range + 2 * group.joints[i];
            EXPECT_GT(of.data->qpos[group.qpos[i]], range[0] - 0.01);
            EXPECT_LT(of.data->qpos[group.qpos[i]], range[1] + 0.01);
          }
        }
        const Pose reached = robot.tcp_pose(of.world, g);
        EXPECT_LT(norm(reached.p - goal.p), 0.002)
            << group.name << " " << absolute << " " << to.x << " " << to.y << " " << to.z;
        EXPECT_LT(angle_between(reached.q, goal.q), 0.5 * std::numbers::pi / 180)
            << group.name << " " << absolute << " " << to.x << " " << to.y << " " << to.z;
      }
      EXPECT_GE(reachable, 3) << group.name;
    }
  }
}

TEST_P(EveryRobot, GrippersOpenAndClose) {
  const Robot& robot = *alone.robot;
  alone.start();
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const MoveGroup& group = robot.groups()[g];
    if (group.kind != GroupKind::kGripper) continue;
    const int index = static_cast<int>(g);
    EXPECT_NEAR(robot.opening(alone.world, index), group.max_opening, 0.003) << "it starts open";
    Action action;
    action.commands[index].set({&group.closed_command, 1});
    alone.play(action, 2.0);
    EXPECT_LT(robot.opening(alone.world, index), 0.002) << group.name;
    action.commands[index].set({&group.open_command, 1});
    alone.play(action, 2.0);
    EXPECT_NEAR(robot.opening(alone.world, index), group.max_opening, 0.003) << group.name;
  }
}

TEST_P(EveryRobot, AMobileBaseReachesItsTarget) {
  const Robot& robot = *alone.robot;
  const int base = alone.find(GroupKind::kBase);
  if (base < 0 || !robot.groups()[base].controlled()) GTEST_SKIP() << "the base is not mobile";
  alone.start({{1, 0.5, 0}, axis_angle({0, 0, 1}, 0.4)});
  const Pose goal{{1.4, 0.2, 0}, axis_angle({0, 0, 1}, 0.9)};
  Action action;
  const MoveGroup& group = robot.groups()[base];
  if (group.command_size == 3) {
    const double place[] = {goal.p.x, goal.p.y, 0.9};
    action.commands[base].set(place);
  } else {
    double pose[7];
    write_pose(goal, pose);
    action.commands[base].set(pose);
  }
  alone.play(action, 4.0);
  expect_same(robot.base_pose(alone.world), goal, 5e-3, "base");
  // Tool pose and kinematics do not depend on the base's position.
  RobotValues q;
  robot.read_qpos(alone.world, q);
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    expect_same(robot.fk(static_cast<int>(g), q), robot.tcp_pose(alone.world, static_cast<int>(g)),
                1e-12, "tool");
  }
}

INSTANTIATE_TEST_SUITE_P(Robots, EveryRobot, ::testing::ValuesIn(robot_names()),
                         [](const auto& info) { return info.param; });

TEST(Robots, HaveTheseNames) {
  EXPECT_THAT(robot_names(),
              ::testing::ElementsAre("bimanual_yam", "floating_rum", "franka", "franka_hand",
                                     "i2rt_yam", "mobile_franka", "rby1"));
}

// The groups, their order and their numbers of qpos and command values are those of MolmoSpaces.
TEST(Robots, GroupsMatchMolmoSpaces) {
  const auto groups = [](const char* name) {
    const Alone alone(name);
    std::string text;
    for (const MoveGroup& g : alone.robot->groups())
      text += fmt::format("{} {}/{} ", g.name, g.qpos.size(), g.command_size);
    return text;
  };
  EXPECT_EQ(groups("franka"), "base 0/0 arm 7/7 gripper 2/1 ");
  EXPECT_EQ(groups("mobile_franka"), "base 3/3 arm 7/7 gripper 2/1 ");
  EXPECT_EQ(groups("i2rt_yam"), "base 0/0 arm 6/6 gripper 2/1 ");
  EXPECT_EQ(groups("bimanual_yam"),
            "base 0/0 left_arm 6/6 right_arm 6/6 left_gripper 2/1 right_gripper 2/1 ");
  EXPECT_EQ(groups("floating_rum"), "base 7/7 gripper 2/1 ");
  EXPECT_EQ(groups("rby1"),
            "base 3/3 torso 6/1 left_arm 7/7 right_arm 7/7 left_gripper 2/1 right_gripper 2/1 head "
            "2/0 ");
}

}  // namespace
}  // namespace mjsense::tasks::robots
