// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/perturbation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <set>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/scene.h"
#include "mjsense_tasks/robots/load_robot.h"

namespace mjsense::tasks::episode {
namespace {

using Kind = Perturbation::Kind;

// A ball with a free joint, and a door with a lever: the lever moves, but the door is what opens.
constexpr char kThings[] = R"(
<mujoco>
  <worldbody>
    <body name="frame" pos="2 0 0">
      <body name="leaf"><joint name="hinge" axis="0 0 1" range="0 90"/><geom type="box" size=".4 .02 1" pos=".4 0 1"/>
        <body name="lever" pos=".7 0 1"><joint name="lever" axis="0 1 0" range="0 45"/><geom size=".05"/>
          <body name="knob" pos="0 .1 0"><geom size=".02"/></body></body></body></body>
    <body name="ball" pos="1 1 1"><freejoint/><geom size=".05"/></body>
  </worldbody>
</mujoco>)";

struct Perturbed : ::testing::Test {
  static scene::SceneCfg scene_cfg() {
    scene::SceneCfg cfg;
    scene::EntityCfg robot, things;
    robot.model = robots::robot_cfg("franka").model;
    things.model.xml = kThings;
    cfg.entities = {{"robot_0", robot}, {"things", things}};
    return cfg;
  }
  void SetUp() override {
    Rng rng(0, 0, 0, 0);
    robot.write_start(robots::state_row(data.get()), {}, rng);
    mj_forward(model, data.get());
  }
  int body(const char* name) const { return mj_name2id(model, mjOBJ_BODY, name); }
  int address(const char* joint) const {
    return model->jnt_qposadr[mj_name2id(model, mjOBJ_JOINT, joint)];
  }
  // Begins an episode with this perturbation.
  void begin(Kind kind) {
    std::int64_t episode = 0;
    do perturbation.begin(1, 5, episode++);
    while (perturbation.kind() != kind);
  }
  // One control step of a policy that closes the gripper. Returns whether the gripper is opened.
  bool apply(int object, int step) {
    robots::Action action;
    const int gripper = robot.gripper();
    action.commands[gripper].set({&robot.groups()[gripper].closed_command, 1});
    perturbation.apply(world, robot, object, step, action, robots::state_row(data.get()));
    return action.commands[gripper].values[0] == robot.groups()[gripper].open_command;
  }

  scene::Scene scene{scene_cfg()};
  const mjModel* model = scene.model();
  robots::Robot robot{robots::robot_cfg("franka"), model, 1};
  DataPtr data = make_data(model);
  World world{.id = 0, .model = model, .data = data.get()};
  Perturbation perturbation;
};

TEST_F(Perturbed, TheShareIsPerturbedAndTheRestIsNot) {
  int perturbed = 0;
  std::set<Kind> kinds;
  for (int episode = 0; episode < 400; ++episode) {
    perturbation.begin(0.25, 3, episode);
    perturbed += perturbation.kind() != Kind::kNone;
    kinds.insert(perturbation.kind());
  }
  EXPECT_NEAR(perturbed, 100, 30);
  EXPECT_EQ(kinds.size(), 3u);
  begin(Kind::kShove);
  for (int step = 0; step < 30; ++step) apply(body("things/ball"), step);
  EXPECT_TRUE(perturbation.happened());
  perturbation.begin(0, 3, 0);
  EXPECT_EQ(perturbation.kind(), Kind::kNone);
  EXPECT_FALSE(perturbation.happened());
}

// Only the horizontal velocity of the object changes, once.
TEST_F(Perturbed, AFreeObjectIsShovedOnce) {
  const int joint = model->body_jntadr[body("things/ball")], dof = model->jnt_dofadr[joint];
  begin(Kind::kShove);
  int shoves = 0;
  for (int step = 0; step < 40; ++step) {
    const std::vector<double> before(data->qvel, data->qvel + model->nv);
    EXPECT_FALSE(apply(body("things/ball"), step));
    for (int i = 0; i < model->nv; ++i) {
      if (i != dof && i != dof + 1) {
        EXPECT_EQ(data->qvel[i], before[i]) << i;
      }
    }
    const double speed =
        std::hypot(data->qvel[dof] - before[dof], data->qvel[dof + 1] - before[dof + 1]);
    if (speed == 0) continue;
    ++shoves;
    EXPECT_GE(step, 5);
    EXPECT_GE(speed, 0.5);
    EXPECT_LE(speed, 0.8);
  }
  EXPECT_EQ(shoves, 1);
}

TEST_F(Perturbed, AHeldObjectIsNotShoved) {
  const int ball = body("things/ball");
  begin(Kind::kShove);
  apply(ball, 0);
  data->qpos[model->jnt_qposadr[model->body_jntadr[ball]] + 2] += 0.02;
  mj_forward(model, data.get());
  for (int step = 1; step < 40; ++step) apply(ball, step);
  EXPECT_FALSE(perturbation.happened());
}

// The gripper opens for six control steps, after the object has been lifted by more than 1 cm.
TEST_F(Perturbed, AGripperSlipsAfterTheObjectWasLifted) {
  const int ball = body("things/ball");
  begin(Kind::kSlip);
  for (int step = 0; step < 20; ++step) EXPECT_FALSE(apply(ball, step));
  data->qpos[model->jnt_qposadr[model->body_jntadr[ball]] + 2] += 0.02;
  mj_forward(model, data.get());
  int opened = 0;
  for (int step = 20; step < 60; ++step) opened += apply(ball, step);
  EXPECT_EQ(opened, 6);
  EXPECT_TRUE(perturbation.happened());
}

// With a lever or its knob the door counts: it is held as soon as it has been opened by 3 % of its
// range. Turning the lever alone does not count.
TEST_F(Perturbed, AGripperSlipsFromALeverWhenTheDoorOpens) {
  for (const char* object : {"things/lever", "things/knob"}) {
    for (const Kind kind : {Kind::kShove, Kind::kSlip}) {
      begin(kind);
      data->qpos[address("things/hinge")] = 1.0;
      data->qpos[address("things/lever")] = 0;
      mj_forward(model, data.get());
      EXPECT_FALSE(apply(body(object), 0));
      data->qpos[address("things/lever")] = 0.5;
      data->qpos[address("things/hinge")] =
          1.0 + 0.02 * model->jnt_range[2 * mj_name2id(model, mjOBJ_JOINT, "things/hinge") + 1];
      mj_forward(model, data.get());
      for (int step = 1; step < 40; ++step) EXPECT_FALSE(apply(body(object), step));
      data->qpos[address("things/hinge")] =
          1.0 + 0.04 * model->jnt_range[2 * mj_name2id(model, mjOBJ_JOINT, "things/hinge") + 1];
      mj_forward(model, data.get());
      int opened = 0;
      for (int step = 40; step < 90; ++step) opened += apply(body(object), step);
      EXPECT_EQ(opened, 6) << object;
    }
  }
}

TEST_F(Perturbed, WhatNoJointMovesIsNotPerturbed) {
  begin(Kind::kSlip);
  for (int step = 0; step < 60; ++step) EXPECT_FALSE(apply(body("things/frame"), step));
  for (int step = 0; step < 60; ++step) EXPECT_FALSE(apply(-1, step));
  EXPECT_FALSE(perturbation.happened());
}

}  // namespace
}  // namespace mjsense::tasks::episode
