// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/collision.h"

#include <gtest/gtest.h>

#include <cmath>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/policies/planner/testing/table_scene.h"

namespace mjsense::tasks::policies {
namespace {

// Reference: mj_collision on the whole model, counting penetrating contacts between robot and
// scene.
bool mujoco_says_free(const TableStage& stage, std::span<const double> q, mjData* d) {
  const mjModel* m = stage.world.model;
  const robots::Robot& robot = stage.robot();
  mju_copy(d->qpos, stage.world.data->qpos, m->nq);
  mju_copy(d->mocap_pos, stage.world.data->mocap_pos, 3 * m->nmocap);
  mju_copy(d->mocap_quat, stage.world.data->mocap_quat, 4 * m->nmocap);
  const auto& address = robot.groups()[robot.arm()].qpos;
  for (std::size_t i = 0; i < q.size(); ++i) d->qpos[address[i]] = q[i];
  mj_kinematics(m, d);
  mj_comPos(m, d);
  mj_collision(m, d);
  const int root = m->body_rootid[robot.base_body()];
  for (int c = 0; c < d->ncon; ++c) {
    const mjContact& contact = d->contact[c];
    const int a = m->geom_bodyid[contact.geom[0]], b = m->geom_bodyid[contact.geom[1]];
    if (contact.dist < 0 && (m->body_rootid[a] == root) != (m->body_rootid[b] == root))
      return false;
  }
  return true;
}

// For random configurations the query finds every collision that mj_collision finds; the additional
// ones are self-collisions of the robot.
TEST(Collision, AgreesWithMuJoCo) {
  TableStage stage("franka");
  const robots::Robot& robot = stage.robot();
  const robots::Chain& chain = robot.chain(robot.arm());
  CollisionModel model(stage.world.model, robot, {chain.joints().begin(), chain.joints().end()});
  CollisionQuery query(model, stage.world);
  const DataPtr d = make_data(stage.world.model);
  Rng rng(1, 0, 0, 0);
  int touching = 0, self = 0;
  std::vector<double> q(chain.joints().size());
  const int root = stage.world.model->body_rootid[robot.base_body()];
  for (int k = 0; k < 3000; ++k) {
    for (std::size_t i = 0; i < q.size(); ++i) q[i] = rng.uniform(chain.low()[i], chain.high()[i]);
    const bool truth = mujoco_says_free(stage, q, d.get()), answer = query.free(q);
    touching += !truth;
    if (truth == answer) continue;
    ASSERT_TRUE(truth) << "configuration " << k << " touches something";
    const auto [a, b] = query.touching();
    EXPECT_EQ(stage.world.model->body_rootid[stage.world.model->geom_bodyid[a]], root);
    EXPECT_EQ(stage.world.model->body_rootid[stage.world.model->geom_bodyid[b]], root);
    ++self;
  }
  EXPECT_GT(touching, 80);
  EXPECT_GT(self, 5);
}

TEST(Collision, StartConfigurationsAreCollisionFree) {
  for (const char* name : {"franka", "mobile_franka", "i2rt_yam", "bimanual_yam", "rby1"}) {
    TableStage stage(name);
    const robots::Robot& robot = stage.robot();
    const robots::Chain& chain = robot.chain(robot.arm());
    CollisionModel model(stage.world.model, robot, {chain.joints().begin(), chain.joints().end()});
    CollisionQuery query(model, stage.world);
    EXPECT_TRUE(query.free_here())
        << name << ": " << scene::name_of(stage.world.model, mjOBJ_GEOM, query.touching().first)
        << ", " << scene::name_of(stage.world.model, mjOBJ_GEOM, query.touching().second);
  }
}

// A held block is free 3 cm above the table and in collision 3 cm below its surface.
TEST(Collision, AHeldObjectMovesWithTheTool) {
  TableStage stage("franka");
  const robots::Robot& robot = stage.robot();
  const int arm = robot.arm(), gripper = robot.gripper();
  const robots::Chain& chain = robot.chain(arm);
  const int block = scene::resolve(stage.world.model, mjOBJ_BODY, "red_block/red_block", "test");
  const Pose down{{0.5, 0.0, 0.75}, {0, 1, 0, 0}};
  robots::RobotValues values;
  robot.read_qpos(stage.world, values);
  ASSERT_TRUE(robot.ik(arm, down, values));
  CollisionModel model(stage.world.model, robot, {chain.joints().begin(), chain.joints().end()});
  const auto touches = [&](double lift, bool held) {
    CollisionQuery query(model, stage.world);
    for (const auto& object : stage.task->all_objects()) {
      if (object.body != block) query.ignore(object.body);
    }
    query.allow(gripper, block);
    if (held) query.hold(arm, gripper, block, Pose{{0, 0, 0.15 - 0.025 - lift}, {0, 1, 0, 0}});
    return !query.free(values[arm].view());
  };
  EXPECT_FALSE(touches(0.03, false));
  EXPECT_FALSE(touches(0.03, true));
  EXPECT_TRUE(touches(-0.03, true));
}

}  // namespace
}  // namespace mjsense::tasks::policies
