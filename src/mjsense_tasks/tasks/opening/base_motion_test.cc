// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/opening/base_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/episode/testing/played_task.h"
#include "mjsense_tasks/tasks/opening/opening.h"

namespace mjsense::tasks {
namespace {

using std::numbers::pi;

// Top view of the base B and the hinge H. A rotation by 90 degrees to the left moves B to B'.
//
//        B'
//        |
//   H    +---- B
TEST(Drive, WithAShareOfOneTheBaseRotatesAboutTheHinge) {
  Articulation one;
  const HandleMotion motion{&one, 0, -pi / 2, {0, 0, -1}, {1, 2, 0}};
  const scenes::BasePose end = driven({2, 2, 0.1}, {.share = 1}, motion, {}, 1);
  EXPECT_NEAR(end.x, 1, 1e-12);
  EXPECT_NEAR(end.y, 3, 1e-12);
  EXPECT_NEAR(end.yaw, 0.1 + pi / 2, 1e-12);
  const scenes::BasePose half = driven({2, 2, 0.1}, {.share = 1}, motion, {}, 0.5);
  EXPECT_NEAR(half.x, 1 + std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(half.y, 2 + std::sqrt(0.5), 1e-12);
  // The additional offset grows linearly along the path.
  const scenes::BasePose aside =
      driven({2, 2, 0}, {.x = 0.2, .y = -0.4, .turn = 0.3}, motion, {}, 0.5);
  EXPECT_NEAR(aside.x, 2.1, 1e-12);
  EXPECT_NEAR(aside.y, 1.8, 1e-12);
  EXPECT_NEAR(aside.yaw, 0.15, 1e-12);
}

// For a drawer, or a lid with a horizontal hinge, the base follows the handle's horizontal motion.
TEST(Drive, OtherwiseTheBaseFollowsTheHandle) {
  Articulation drawer;
  drawer.slide = true;
  const HandleMotion out{&drawer, 0, 0.3, {-1, 0, 0}, {}};
  const scenes::BasePose back = driven({-0.6, 0.2, 0.4}, {.share = 0.5}, out, {0, 0.1, 0.7}, 1);
  EXPECT_NEAR(back.x, -0.75, 1e-12);
  EXPECT_NEAR(back.y, 0.2, 1e-12);
  EXPECT_NEAR(back.yaw, 0.4, 1e-12);
  Articulation lid;
  const HandleMotion down{&lid, 0, pi / 2, {0, -1, 0}, {0, 0, 0.2}};
  const scenes::BasePose away = driven({-0.6, 0.2, 0.4}, {.share = 1}, down, {0, 0.1, 0.7}, 1);
  EXPECT_NEAR(away.x, -1.1, 1e-12);
  EXPECT_NEAR(away.y, 0.2, 1e-12);
}

// RB-Y1 opens the fridge farther than its arms alone can. The gripper stays on the handle to the
// accuracy of inverse kinematics, and no other part of the robot touches anything.
TEST(Drive, BaseAndArmKeepTheGripperOnTheHandle) {
  episode::TaskCfg cfg;
  cfg.robot = robots::robot_cfg("rby1");
  OpeningTask task(cfg, OpeningKind::kOpen);
  const scene::Scene scene(task.scene_cfg_with_robot());
  task.initialize(scene.model(), 1);
  const DataPtr data = make_data(scene.model());
  mj_resetData(scene.model(), data.get());
  const robots::Robot& robot = task.robot();
  const HandleReach& reach = task.reach();
  task.sample(0, 0, robots::state_row(data.get()));
  for (const Articulation& one : task.articulations()) data->qpos[one.qpos] = one.closed;
  mj_kinematics(scene.model(), data.get());
  const World world{.id = 0, .model = scene.model(), .data = data.get()};
  const auto fridge = std::ranges::find(task.articulations(), "fridge", &Articulation::category);
  ASSERT_NE(fridge, task.articulations().end());
  const double to = task.aim(*fridge);
  EXPECT_GT(fridge->fraction(to), 0.67);
  const auto start = reach.start_of(world);
  const BaseSearch search(robot, reach, start, robot.base_pose(world));
  const BasePlaces places = search.places(*fridge, fridge->closed, to);
  ASSERT_FALSE(places.at.empty());
  EXPECT_TRUE(places.driving);
  const auto there = search.placed(start, places.at[0]);
  EXPECT_FALSE(reach.find(there, *fridge, fridge->closed, to, 10, false));
  const auto path = reach.find(there, *fridge, fridge->closed, to, 10, true);
  ASSERT_TRUE(path);
  ASSERT_GT(path->motion_joints.size(), 2u);
  const Pose last = reach.body_pose(there, *fridge, to) * path->on_body;
  const robots::RobotValues& end = path->motion_joints.back();
  const auto at = end[reach.base()].values;
  const Pose base{{at[0], at[1], places.at[0].p.z}, axis_angle({0, 0, 1}, at[2])};
  const Pose tool = base * robot.fk(path->hand.tool, end);
  EXPECT_LT(norm(tool.p - last.p), 2e-4);
  EXPECT_LT(angle_between(tool.q, last.q), 2e-4);
  EXPECT_GT(norm(base.p - places.at[0].p), 0.1);
  // In MuJoCo's contacts, only the gripper touches something, and only the door is touched.
  mju_copy(data->qpos, there.qpos.data(), scene.model()->nq);
  for (int group : {path->hand.tool, reach.base()}) {
    for (std::size_t i = 0; i < robot.groups()[group].qpos.size(); ++i)
      data->qpos[robot.groups()[group].qpos[i]] = end[group].values[i];
  }
  data->qpos[fridge->qpos] = to;
  mj_fwdPosition(scene.model(), data.get());
  const int root = scene.model()->body_rootid[robot.base_body()];
  const int hand = robot.groups()[path->hand.gripper].root_body;
  int touching = 0;
  for (int c = 0; c < data->ncon; ++c) {
    int mine = scene.model()->geom_bodyid[data->contact[c].geom[0]],
        other = scene.model()->geom_bodyid[data->contact[c].geom[1]];
    if (scene.model()->body_rootid[mine] != root) std::swap(mine, other);
    if (scene.model()->body_rootid[mine] != root || data->contact[c].dist > 0) continue;
    EXPECT_TRUE(observe::is_descendant_or_self(scene.model(), mine, hand) &&
                observe::is_descendant_or_self(scene.model(), other, fridge->body))
        << scene::name_of(scene.model(), mjOBJ_BODY, mine) << " in "
        << scene::name_of(scene.model(), mjOBJ_BODY, other);
    ++touching;
  }
  EXPECT_EQ(touching, 0) << "the hand is open";
}

TEST(Opening, OpenedFractionDependsOnTheRobot) {
  for (const auto& [name, opened] : {std::pair{"franka", 0.15}, {"rby1", 0.67}}) {
    episode::PlayedTask<OpeningTask> played(1, episode::task_cfg(name), OpeningKind::kOpen);
    const World world = played.start(0);
    const OpeningTask& task = played.task;
    mjData* data = world.data;
    EXPECT_EQ(task.opened(), opened);
    const Articulation& one = task.target(0);
    EXPECT_GT(one.fraction(task.aim(one)), opened + 0.05);
    data->qpos[one.qpos] = one.at(opened - 0.001);
    EXPECT_FALSE(task.evaluate(world).success) << name;
    data->qpos[one.qpos] = one.at(opened + 0.001);
    EXPECT_TRUE(task.evaluate(world).success) << name;
    // The success threshold corresponds to the pose in obj_end.
    data->qpos[one.qpos] = one.at(opened);
    mj_kinematics(world.model, data);
    const Pose goal = *task.goal_pose(0, "pickup_obj");
    EXPECT_NEAR(norm(goal.p - vec3(data->xpos + 3 * one.body)), 0, 1e-9);
  }
}

}  // namespace
}  // namespace mjsense::tasks
