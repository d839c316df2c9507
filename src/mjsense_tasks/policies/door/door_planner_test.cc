// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/door/door_planner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "mjsense/core/model_geometry.h"
#include "mjsense_tasks/episode/testing/played_task.h"
#include "mjsense_tasks/policies/planner/pick_loop.h"
#include "mjsense_tasks/tasks/door_opening/door_opening.h"

namespace mjsense::tasks::policies {
namespace {

struct DoorPlan : ::testing::Test, episode::PlayedTask<tasks::DoorOpeningTask> {
  static episode::TaskCfg cfg() {
    episode::TaskCfg cfg = episode::task_cfg("rby1");
    cfg.horizon = 400;
    return cfg;
  }
  DoorPlan() : PlayedTask(1, cfg()) {}
};

// DoorGeometry::carried() agrees with MuJoCo's kinematics of the door joints.
TEST_F(DoorPlan, HandleMotionAgreesWithMuJoCosKinematics) {
  start(0);
  const scenes::Door& door = task.door(0);
  const DoorGeometry geometry(model, data.get(), door, task.robot().base_pose(world).p);
  const Pose handle = body_pose(data.get(), door.handle);
  const double leaf = 0.6 * (door.open - door.shut);
  const Pose expected = geometry.carried(handle, geometry.press, leaf);
  data->qpos[model->jnt_qposadr[door.joint]] += leaf;
  data->qpos[model->jnt_qposadr[door.handle_joint]] += geometry.press;
  mj_forward(model, data.get());
  EXPECT_LT(norm(expected.p - vec3(data->xpos + 3 * door.handle)), 1e-9);
  EXPECT_LT(angle_between(expected.q, quat(data->xquat + 4 * door.handle)), 1e-6);
}

TEST_F(DoorPlan, GraspsCloseAcrossTheBarOnTheRobotsSide) {
  std::set<bool> sides;
  for (int episode = 0; episode < 8; ++episode) {
    start(episode);
    sides.insert(task.push(0));
    const scenes::Door& door = task.door(0);
    const DoorGeometry geometry(model, data.get(), door, task.robot().base_pose(world).p);
    const robots::MoveGroup& gripper = task.robot().group("right_gripper");
    const Vec3 closing = closing_direction(data.get(), gripper);
    const auto grasps = handle_grasps(model, data.get(), door, geometry, closing);
    ASSERT_TRUE(grasps);
    for (const Pose& pose : grasps->poses) {
      EXPECT_GT(dot(pose.p - scenes::leaf_middle(model, data.get(), door), geometry.away), 0.04);
      EXPECT_NEAR(dot(rotate(pose.q, {0, 0, 1}), geometry.away), -1, 1e-9)
          << "the approach is perpendicular to the leaf";
      EXPECT_NEAR(std::abs(rotate(pose.q, closing).z), 1, 1e-6)
          << "the bar is horizontal, so the fingers close vertically";
    }
  }
  EXPECT_EQ(sides.size(), 2u);
}

TEST_F(DoorPlan, OpensTheDoor) {
  DoorPlanner planner;
  task.register_policy(planner);
  int opened = 0;
  for (int episode = 0; episode < 3; ++episode) {
    const EpisodeResult result = run_episode(task, planner, data.get(), 0, episode);
    opened += result.success ? 1 : 0;
    EXPECT_EQ(result.reward, result.success ? 1 : 0);
  }
  EXPECT_GE(opened, 2);
}

}  // namespace
}  // namespace mjsense::tasks::policies
