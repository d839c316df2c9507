// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/standing.h"

#include <gtest/gtest.h>

#include <memory>

#include "mjsense/robots/load_robot.h"
#include "mjsense/scenes/load_scene.h"
#include "mjsense/tasks/pick/pick.h"

namespace mjsense {
namespace {

Pose offset_of(const char* robot_name) {
  EpisodeScene scene(load_scene("table"));
  TaskCfg cfg;
  cfg.robot = robot_cfg(robot_name);
  PickTask task(cfg);
  Scene compiled(task.whole_scene_cfg());
  Robot robot(cfg.robot, compiled.model(), 1);
  scene.initialize(compiled.model(), 1, "robot_0/");
  return Standing(compiled.model(), robot, scene).offset();
}

// The table was made for the Franka.
TEST(Standing, WhoReachesStaysWhereTheSceneSays) {
  for (const char* robot : {"franka", "mobile_franka"}) {
    const Pose offset = offset_of(robot);
    EXPECT_EQ(norm(offset.p), 0) << robot;
    EXPECT_EQ(offset.q.w, 1) << robot;
  }
}

// The tops are 0.6 m high, RB-Y1's hands twice that.
TEST(Standing, WhoCanStoopDoesWhereATableIsLow) {
  EpisodeScene scene(load_scene("table"));
  TaskCfg cfg;
  cfg.robot = robot_cfg("rby1");
  PickTask task(cfg);
  Scene compiled(task.whole_scene_cfg());
  Robot robot(cfg.robot, compiled.model(), 1);
  const int torso = robot.group_index("torso");
  const std::vector<double> upright = robot.cfg().groups[torso].init;
  scene.initialize(compiled.model(), 1, "robot_0/");
  const Standing standing(compiled.model(), robot, scene);
  EXPECT_EQ(robot.cfg().groups[torso].init, cfg.robot.groups[torso].stooped);
  EXPECT_NE(robot.cfg().groups[torso].init, upright);
  EXPECT_LE(std::abs(standing.offset().p.x), 0.2);
}

// Wherever the scene puts it: not in the table, from which it would be pushed off its place.
TEST(Standing, WhoMovesNearerStandsInNothing) {
  TaskCfg cfg;
  cfg.robot = robot_cfg("rby1");
  cfg.scene = "tableware";
  PickTask task(cfg);
  Scene scene(task.whole_scene_cfg());
  task.initialize(scene.model(), 1);
  const mjModel* model = scene.model();
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> data(mj_makeData(model), mj_deleteData);
  const int root = model->body_rootid[task.robot().base_body()];
  for (int episode = 0; episode < 16; ++episode) {
    mj_resetData(model, data.get());
    task.sample(0, episode, state_row(data.get()));
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

TEST(Standing, AFloatingHandHangsAboveTheTargetsPointingDown) {
  const Pose offset = offset_of("floating_rum");
  EXPECT_NEAR(offset.p.x, 0.54 - 0.15, 1e-9);
  EXPECT_NEAR(offset.p.z, 0.6 + 0.35 + 0.235, 1e-3);
  EXPECT_LT(rotate(offset.q, {0, 0, 1}).z, -0.999);
}

}  // namespace
}  // namespace mjsense
