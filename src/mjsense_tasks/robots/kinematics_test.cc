// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/kinematics.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "mjsense/core/model_geometry.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/testing/test_model.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense_tasks/robots/load_robot.h"

namespace mjsense::tasks::robots {
namespace {

struct Fr3 : ::testing::Test {
  void SetUp() override {
    const RobotCfg robot = robot_cfg("franka");
    const scene::SpecPtr spec(mj_copySpec(robot.model.spec));
    owned_model.reset(mj_compile(spec.get(), nullptr));
    ASSERT_TRUE(owned_model) << mjs_getError(spec.get());
    owned_data = make_data(owned_model.get());
    model = owned_model.get();
    data = owned_data.get();
    for (int i = 1; i <= 7; ++i) {
      joints.push_back(mj_name2id(model, mjOBJ_JOINT, ("fr3_joint" + std::to_string(i)).c_str()));
    }
    base = mj_name2id(model, mjOBJ_BODY, "base");
    site = mj_name2id(model, mjOBJ_SITE, "gripper/grasp_site");
    chain = std::make_unique<Chain>(model, base, site, joints);
  }
  std::array<double, 7> random_configuration(Rng& rng) const {
    std::array<double, 7> q;
    for (int i = 0; i < 7; ++i) q[i] = rng.uniform(chain->low()[i], chain->high()[i]);
    return q;
  }

  ModelPtr owned_model;
  DataPtr owned_data;
  mjModel* model = nullptr;
  mjData* data = nullptr;
  std::vector<int> joints;
  int base = -1, site = -1;
  std::unique_ptr<Chain> chain;
};

TEST_F(Fr3, ForwardKinematicsAndJacobianAgreeWithMuJoCo) {
  Rng rng(1, 0, 0, 0);
  std::array<double, 6 * 7> jac;
  std::vector<double> jacp(3 * model->nv), jacr(3 * model->nv);
  for (int trial = 0; trial < 200; ++trial) {
    const auto q = random_configuration(rng);
    for (int i = 0; i < 7; ++i) data->qpos[model->jnt_qposadr[joints[i]]] = q[i];
    mj_kinematics(model, data);
    mj_comPos(model, data);
    const Pose expected = site_pose(data, site);
    const Pose leaf = chain->jacobian(q, jac);
    EXPECT_LT(norm(leaf.p - expected.p), 1e-12);
    EXPECT_LT(angle_between(leaf.q, expected.q), 1e-7);
    EXPECT_LT(norm(chain->fk(q).p - leaf.p), 1e-14);
    mj_jacSite(model, data, jacp.data(), jacr.data(), site);
    for (int i = 0; i < 7; ++i) {
      const int dof = model->jnt_dofadr[joints[i]];
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(jac[k * 7 + i], jacp[k * model->nv + dof], 1e-10);
        EXPECT_NEAR(jac[(3 + k) * 7 + i], jacr[k * model->nv + dof], 1e-10);
      }
    }
  }
}

// A chain with a slide joint and with joints that are offset from their body's origin.
TEST(Chain, OffsetJointsAgreeWithMuJoCo) {
  const char* xml = R"(<mujoco><worldbody><body name="base" pos=".1 0 .2" euler="10 0 20">
      <geom size=".1"/>
      <body pos="0 .1 .3" euler="0 30 0"><joint name="a" pos=".1 -.2 .05" axis=".2 1 0" range="-90 90"/><geom size=".1"/>
        <body pos=".2 0 0"><joint name="b" type="slide" pos=".1 0 0" axis="1 0 1" range="-1 1"/><geom size=".1"/>
          <body pos="0 .2 0"><joint name="c" pos="0 .1 -.1" axis="0 0 1" range="-90 90"/><geom size=".1"/>
            <site name="leaf" pos=".1 .1 .1" euler="0 0 40"/></body></body></body></body></worldbody></mujoco>)";
  const TestModel own(xml);
  const mjModel* model = own.model;
  mjData* data = own.data;
  const int joints[] = {0, 1, 2};
  const Chain chain(model, 1, 0, joints);
  const std::array<double, 3> q{0.7, -0.3, -1.1};
  std::copy(q.begin(), q.end(), data->qpos);
  mj_kinematics(model, data);
  const Pose leaf = inverse(pose_from_mat(data->xpos + 3, data->xmat + 9)) *
                    pose_from_mat(data->site_xpos, data->site_xmat);
  std::array<double, 6 * 3> jac;
  for (const Pose& pose : {chain.fk(q), chain.jacobian(q, jac)}) {
    EXPECT_LT(norm(pose.p - leaf.p), 1e-12);
    EXPECT_LT(angle_between(pose.q, leaf.q), 1e-7);
  }
}

// The joint motion is exact away from singular configurations and bounded near them. Every fourth
// configuration is singular or close to it: arm stretched out and wrist aligned.
TEST_F(Fr3, JointMotionIsDampedNearSingularConfigurations) {
  Rng rng(3, 0, 0, 0);
  std::array<double, 6 * 7> jac;
  std::array<double, 7> dq;
  int exact = 0;
  double largest = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    std::array<double, 7> q = random_configuration(rng);
    if (trial % 4 == 0) {
      for (int i = 1; i < 7; ++i)
        q[i] = std::clamp(trial % 8 ? 0.0 : 1e-3 * rng.normal(), chain->low()[i], chain->high()[i]);
    }
    double e[6], square = 0;
    for (double& x : e) x = 0.01 * rng.normal();
    chain->joint_motion(q, {{e[0], e[1], e[2]}, {e[3], e[4], e[5]}}, dq);
    chain->jacobian(q, jac);
    double error = 0, twist = 0;
    for (int i = 0; i < 6; ++i) {
      double moved = 0;
      for (int k = 0; k < 7; ++k) moved += jac[7 * i + k] * dq[k];
      error += (moved - e[i]) * (moved - e[i]);
      twist += e[i] * e[i];
    }
    for (double d : dq) square += d * d;
    largest = std::max(largest, std::sqrt(square / twist));
    exact += std::sqrt(error / twist) < 1e-6;
  }
  EXPECT_LT(largest, 15);
  EXPECT_GT(largest, 10) << "the bound is reached";
  EXPECT_GT(exact, 10000);
}

TEST_F(Fr3, InverseKinematicsConvergesOnReachablePoses) {
  Rng rng(2, 0, 0, 0);
  int solved = 0;
  const int trials = 1000;
  for (int trial = 0; trial < trials; ++trial) {
    const Pose target = chain->fk(random_configuration(rng));
    std::array<double, 7> q{0, -0.7853, 0, -2.35619, 0, 1.57079, 0};
    if (!chain->ik(target, q)) continue;
    const Twist error = log6(inverse(chain->fk(q)) * target);
    EXPECT_LT(norm(error), 1e-4);
    for (int i = 0; i < 7; ++i) {
      EXPECT_GE(q[i], chain->low()[i]);
      EXPECT_LE(q[i], chain->high()[i]);
    }
    ++solved;
  }
  RecordProperty("solved", solved);
  EXPECT_GE(solved, 990) << "of " << trials;
}

TEST_F(Fr3, InverseKinematicsGivesUpOutOfReach) {
  std::array<double, 7> q{0, -0.7853, 0, -2.35619, 0, 1.57079, 0};
  EXPECT_FALSE(chain->ik({{2.0, 0, 0.5}, {}}, q));
}

// The early test of the link lengths never rejects a reachable pose.
TEST_F(Fr3, ReachablePosesAreNeverOutOfReach) {
  Rng rng(5, 0, 0, 0);
  for (int trial = 0; trial < 1000; ++trial) {
    std::array<double, 7> q = random_configuration(rng);
    if (trial % 3 == 0) {  // stretched out
      for (int i = 1; i < 7; ++i) q[i] = std::clamp(0.0, chain->low()[i], chain->high()[i]);
    }
    bool moves[7] = {true, true, true, true, true, true, true};
    for (int i = 0; i < trial % 5; ++i) moves[i] = false;
    EXPECT_TRUE(chain->ik(chain->fk(q), q, 1, 1e-4, moves)) << "the start is already at the target";
  }
}

TEST_F(Fr3, FixedJointsDoNotMove) {
  Rng rng(6, 0, 0, 0);
  int solved = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const std::array<double, 7> goal = random_configuration(rng);
    std::array<double, 7> q = goal;
    for (int i = 1; i < 7; ++i) q[i] += rng.uniform(-0.3, 0.3);
    const bool moves[7] = {false, true, true, true, true, true, true};
    if (!chain->ik(chain->fk(goal), q, 1000, 1e-4, moves)) continue;
    EXPECT_EQ(q[0], goal[0]);
    EXPECT_LT(norm(log6(inverse(chain->fk(q)) * chain->fk(goal))), 1e-4);
    ++solved;
  }
  EXPECT_GE(solved, 150);
}

}  // namespace
}  // namespace mjsense::tasks::robots
