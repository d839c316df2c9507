// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/base_placement_search.h"

#include <gtest/gtest.h>

#include <fstream>

#include "mjsense/core/testing/temp_dir.h"
#include "mjsense_tasks/episode/testing/played_task.h"
#include "mjsense_tasks/scenes/load_scene.h"
#include "mjsense_tasks/tasks/pick/pick.h"

namespace mjsense::tasks::scenes {
namespace {

// The placement of a robot in a scene.
struct Placement {
  Placement(const char* robot_name, const char* scene_name)
      : scene(load_scene(scene_name)),
        task(episode::task_cfg(robot_name, scene_name)),
        compiled(task.scene_cfg_with_robot()),
        robot(task.cfg().robot, compiled.model(), 1) {
    scene.initialize(compiled.model(), 1, "robot_0/");
    offset = BasePlacementSearch(compiled.model(), robot, scene).offset();
  }

  EpisodeScene scene;
  tasks::PickTask task;
  scene::Scene compiled;
  robots::Robot robot;
  Pose offset;
};

// The table scene was made for the Franka.
TEST(BasePlacementSearch, KeepsThePlacementIfReachable) {
  for (const char* robot : {"franka", "mobile_franka"}) {
    const Pose offset = Placement(robot, "table").offset;
    EXPECT_EQ(norm(offset.p), 0) << robot;
    EXPECT_EQ(offset.q.w, 1) << robot;
  }
}

// The table tops are 0.6 m high; RB-Y1's hands are at twice that height.
TEST(BasePlacementSearch, StoopsAtALowTable) {
  const Placement placement("rby1", "table");
  const int torso = placement.robot.group_index("torso");
  const std::vector<double>& init = placement.robot.cfg().groups[torso].init;
  const robots::MoveGroupCfg& given = placement.task.cfg().robot.groups[torso];
  EXPECT_EQ(init, given.low_init);
  EXPECT_NE(init, given.init);
  EXPECT_LE(std::abs(placement.offset.p.x), 0.2);
}

// At no base pose that the scene can sample may the robot penetrate the table, which would push it
// away.
TEST(BasePlacementSearch, MovedBaseIsCollisionFree) {
  episode::PlayedTask<tasks::PickTask> played(1, episode::task_cfg("rby1", "tableware"));
  const mjModel* model = played.model;
  const mjData* data = played.data.get();
  const int root = model->body_rootid[played.task.robot().base_body()];
  for (int episode = 0; episode < 16; ++episode) {
    played.start(episode);
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
    episode::PlayedTask<tasks::PickTask> played(1,
                                                episode::task_cfg(robot, dir.file("scene.toml")));
    EXPECT_NEAR(played.task.robot().base_pose(played.start(0)).p.z, z, 1e-9) << robot;
  }
}

// The YAM is short: the upper board of the shelf is out of its reach, the others are not.
TEST(BasePlacementSearch, TargetsAreLimitedToRegionsThatAHandReaches) {
  for (const auto& [robot_name, upper] : {std::pair{"franka", true}, {"i2rt_yam", false}}) {
    const Placement placement(robot_name, "shelf");
    const auto regions = placement.scene.regions();
    ASSERT_EQ(regions.size(), 3u);
    EXPECT_TRUE(regions[1].for_targets) << robot_name;
    EXPECT_EQ(regions[2].for_targets, upper) << robot_name;
  }
}

TEST(BasePlacementSearch, FloatingHandIsAboveTheTargets) {
  const Pose offset = Placement("floating_rum", "table").offset;
  EXPECT_NEAR(offset.p.x, 0.54 - 0.15, 1e-9);
  EXPECT_NEAR(offset.p.z, 0.6 + 0.35 + 0.235, 1e-3);
  EXPECT_LT(rotate(offset.q, {0, 0, 1}).z, -0.999);
}

}  // namespace
}  // namespace mjsense::tasks::scenes
