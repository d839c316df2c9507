// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/base_placement_search.h"

#include <gtest/gtest.h>

#include <fstream>
#include <memory>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense_tasks/robots/load_robot.h"
#include "mjsense_tasks/scenes/load_scene.h"
#include "mjsense_tasks/tasks/pick/pick.h"

namespace mjsense::tasks::scenes {
namespace {

Pose offset_of(const char* robot_name) {
  EpisodeScene scene(load_scene("table"));
  episode::TaskCfg cfg;
  cfg.robot = robots::robot_cfg(robot_name);
  cfg.scene = "table";
  tasks::PickTask task(cfg);
  scene::Scene compiled(task.scene_cfg_with_robot());
  robots::Robot robot(cfg.robot, compiled.model(), 1);
  scene.initialize(compiled.model(), 1, "robot_0/");
  return BasePlacementSearch(compiled.model(), robot, scene).offset();
}

// The table scene was made for the Franka.
TEST(BasePlacementSearch, KeepsThePlacementIfReachable) {
  for (const char* robot : {"franka", "mobile_franka"}) {
    const Pose offset = offset_of(robot);
    EXPECT_EQ(norm(offset.p), 0) << robot;
    EXPECT_EQ(offset.q.w, 1) << robot;
  }
}

// The table tops are 0.6 m high; RB-Y1's hands are at twice that height.
TEST(BasePlacementSearch, StoopsAtALowTable) {
  EpisodeScene scene(load_scene("table"));
  episode::TaskCfg cfg;
  cfg.robot = robots::robot_cfg("rby1");
  cfg.scene = "table";
  tasks::PickTask task(cfg);
  scene::Scene compiled(task.scene_cfg_with_robot());
  robots::Robot robot(cfg.robot, compiled.model(), 1);
  const int torso = robot.group_index("torso");
  const std::vector<double> upright = robot.cfg().groups[torso].init;
  scene.initialize(compiled.model(), 1, "robot_0/");
  const BasePlacementSearch standing(compiled.model(), robot, scene);
  EXPECT_EQ(robot.cfg().groups[torso].init, cfg.robot.groups[torso].low_init);
  EXPECT_NE(robot.cfg().groups[torso].init, upright);
  EXPECT_LE(std::abs(standing.offset().p.x), 0.2);
}

// At no base pose that the scene can sample may the robot penetrate the table, which would push it
// away.
TEST(BasePlacementSearch, MovedBaseIsCollisionFree) {
  episode::TaskCfg cfg;
  cfg.robot = robots::robot_cfg("rby1");
  cfg.scene = "tableware";
  tasks::PickTask task(cfg);
  scene::Scene scene(task.scene_cfg_with_robot());
  task.initialize(scene.model(), 1);
  const mjModel* model = scene.model();
  const DataPtr data = make_data(model);
  const int root = model->body_rootid[task.robot().base_body()];
  for (int episode = 0; episode < 16; ++episode) {
    mj_resetData(model, data.get());
    task.sample(0, episode, robots::state_row(data.get()));
    mj_forward(model, data.get());
    for (int c = 0; c < data->ncon; ++c) {
      const mjContact& contact = data->contact[c];
      const int a = model->body_rootid[model->geom_bodyid[contact.geom[0]]];
      const int b = model->body_rootid[model->geom_bodyid[contact.geom[1]]];
      if ((a == root) != (b == root)) {
        EXPECT_GT(contact.dist, -0.001) << episode;
      }
    }
  }
}

// The scene has a pedestal for the robot above the ground, which is not at z = 0.
TEST(BasePlacementSearch, MobileBaseIsOnTheGround) {
  const testing::TempDir dir;
  std::ofstream(dir.file("room.xml")) << R"(<mujoco><worldbody>
      <geom type="plane" size="3 3 .1" pos="0 0 .5" contype="0" conaffinity="0"/>
      <geom type="plane" size="3 3 .1" pos="-3 0 0" euler="0 90 0"/>
      <body name="floor" pos="0 0 -.05"><geom type="plane" size="3 3 .1" pos="0 0 -.1"/></body>
      <geom name="top" type="box" size=".3 .3 .02" pos=".7 0 .68"/>
    </worldbody></mujoco>)";
  std::ofstream(dir.file("cube.xml")) << R"(<mujoco><worldbody><body name="cube"><freejoint/>
      <geom type="box" size=".02 .02 .02"/></body></worldbody></mujoco>)";
  std::ofstream(dir.file("scene.toml")) << R"(name = "raised"
robot = {pos = [0, 0, 0.1]}
regions = [{name = "table", on = "room/top"}]
[[entities]]
name = "room"
model = "room.xml"
[[entities]]
name = "cube"
model = "cube.xml"
)";
  for (const auto& [robot, z] : {std::pair{"franka", 0.1}, {"mobile_franka", -0.15}}) {
    episode::TaskCfg cfg;
    cfg.robot = robots::robot_cfg(robot);
    cfg.scene = dir.file("scene.toml");
    tasks::PickTask task(cfg);
    scene::Scene scene(task.scene_cfg_with_robot());
    const mjModel* model = scene.model();
    task.initialize(model, 1);
    const DataPtr data = make_data(model);
    task.sample(0, 0, robots::state_row(data.get()));
    mj_kinematics(model, data.get());
    EXPECT_NEAR(task.robot().base_pose({.id = 0, .model = model, .data = data.get()}).p.z, z, 1e-9)
        << robot;
  }
}

// The YAM is short: the upper board of the shelf is out of its reach, the others are not.
TEST(BasePlacementSearch, TargetsAreLimitedToRegionsThatAHandReaches) {
  for (const auto& [robot_name, upper] : {std::pair{"franka", true}, {"i2rt_yam", false}}) {
    EpisodeScene scene(load_scene("shelf"));
    episode::TaskCfg cfg;
    cfg.robot = robots::robot_cfg(robot_name);
    cfg.scene = "shelf";
    tasks::PickTask task(cfg);
    const scene::Scene compiled(task.scene_cfg_with_robot());
    robots::Robot robot(cfg.robot, compiled.model(), 1);
    scene.initialize(compiled.model(), 1, "robot_0/");
    const BasePlacementSearch standing(compiled.model(), robot, scene);
    ASSERT_EQ(scene.regions().size(), 3u);
    EXPECT_TRUE(scene.regions()[1].for_targets) << robot_name;
    EXPECT_EQ(scene.regions()[2].for_targets, upper) << robot_name;
  }
}

TEST(BasePlacementSearch, FloatingHandIsAboveTheTargets) {
  const Pose offset = offset_of("floating_rum");
  EXPECT_NEAR(offset.p.x, 0.54 - 0.15, 1e-9);
  EXPECT_NEAR(offset.p.z, 0.6 + 0.35 + 0.235, 1e-3);
  EXPECT_LT(rotate(offset.q, {0, 0, 1}).z, -0.999);
}

}  // namespace
}  // namespace mjsense::tasks::scenes
