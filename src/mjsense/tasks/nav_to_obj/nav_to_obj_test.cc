// SPDX-License-Identifier: Apache-2.0
#include "mjsense/tasks/nav_to_obj/nav_to_obj.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "mjsense/episode/testing/played_task.h"

namespace mjsense {
namespace {

struct Nav : testing::Test, PlayedTask<NavToObjTask> {
  Nav() : PlayedTask(task_cfg("rby1"), 2) {}
  // The robot at a distance from its target, facing it or away; false where there is no such place.
  bool stand(double distance, double turned) {
    const double* at = data->xpos + 3 * task.objects(0)[0].body;
    const Vec3 target = vec3(at);
    const auto& base = task.robot().group("base").qpos;
    // From the side on which there is most floor: try all around for one that is free.
    for (int k = 0; k < 36; ++k) {
      const double a = k * 3.14159265 / 18;
      const BasePose p{target.x - distance * std::cos(a), target.y - distance * std::sin(a),
                       a + turned};
      data->qpos[base[0]] = p.x;
      data->qpos[base[1]] = p.y;
      data->qpos[base[2]] = p.yaw;
      mj_forward(model, data.get());
      if (task.routes()->free(p) &&
          (turned != 0 || task.sees(world, task.camera_pose(world), task.candidates(0)[0])))
        return true;
    }
    return false;
  }
};

TEST_F(Nav, RewardFallsWithTheDistanceOfWhatIsSeen) {
  int tested = 0;
  for (int episode = 0; episode < 16 && tested < 3; ++episode) {
    start(episode);
    if (task.candidates(0).size() > 1) continue;
    EXPECT_EQ(task.evaluate(world).lacks, "the object is too far away");
    if (!stand(1.25, 0)) continue;
    const Evaluation e = task.evaluate(world);
    EXPECT_NEAR(e.reward, 1 - 1.25 / 1.5, 1e-6);
    EXPECT_TRUE(e.success);
    EXPECT_EQ(e.lacks, "");
    ASSERT_TRUE(stand(1.25, 3.14159265));
    EXPECT_EQ(task.evaluate(world).reward, 0) << "behind its back";
    EXPECT_EQ(task.evaluate(world).lacks, "the camera does not see the object");
    ++tested;
  }
  EXPECT_EQ(tested, 3);
}

// Out of sight wherever the robot drives: such a start is drawn again.
TEST_F(Nav, WhatIsSeenFromNowhereIsNoTarget) {
  start(0);
  EXPECT_EQ(task.start_fault(world), "");
  for (int index : task.candidates(0)) {
    const int body = task.scene_object(index).body;
    data->qpos[model->jnt_qposadr[model->body_jntadr[body]] + 2] = 10;  // above the ceiling
  }
  mj_forward(model, data.get());
  EXPECT_EQ(task.start_fault(world), "task 'nav_to_obj': robot 'rby1' sees no " +
                                         task.objects(0)[0].name +
                                         " in scene 'floor' from anywhere that it can drive to");
}

TEST_F(Nav, WhatStandsBehindSomethingIsNotSeen) {
  start(0);
  ASSERT_TRUE(stand(1.2, 0));
  const int index = task.candidates(0)[0];
  const int body = task.scene_object(index).body;
  double* qpos = data->qpos + model->jnt_qposadr[model->body_jntadr[body]];
  const Pose camera = task.camera_pose(world);
  ASSERT_TRUE(task.sees(world, camera, index));
  qpos[2] = 10;  // above the ceiling
  mj_forward(model, data.get());
  EXPECT_FALSE(task.sees(world, camera, index));
  // Before the camera, wherever it looks.
  write_vec(camera * Vec3{0, 0, -0.4}, qpos);
  mj_forward(model, data.get());
  EXPECT_TRUE(task.sees(world, camera, index));
  write_vec(camera * Vec3{0, 0, 0.4}, qpos);  // behind it
  mj_forward(model, data.get());
  EXPECT_FALSE(task.sees(world, camera, index));
}

TEST_F(Nav, CandidatesAreOfOneKindAndAllThatAreThere) {
  std::set<std::size_t> counts;
  for (int episode = 0; episode < 40; ++episode) {
    start(episode);
    const auto candidates = task.candidates(0);
    const std::string& text = task.scene_object(candidates[0]).text;
    for (int i : candidates) {
      EXPECT_EQ(task.scene_object(i).text, text);
      EXPECT_LT(std::abs(data->xpos[3 * task.scene_object(i).body]), 50) << "is there";
    }
    counts.insert(candidates.size());
    EXPECT_EQ(task.description(0), candidates.size() == 1
                                       ? "Navigate to the " + text
                                       : "Navigate to any " + text + " (" +
                                             std::to_string(candidates.size()) + " available)");
    const Pose base = task.robot().base_pose(world);
    const auto [nearest, distance] = task.nearest(world, base.p.x, base.p.y);
    double least = 1e10;
    for (int i : candidates) {
      const double* at = data->xpos + 3 * task.scene_object(i).body;
      least = std::min(least, std::hypot(at[0] - base.p.x, at[1] - base.p.y));
    }
    EXPECT_EQ(distance, least);
    EXPECT_TRUE(std::ranges::count(candidates, nearest));
    EXPECT_EQ(task.start_fault(world), "");
  }
  EXPECT_EQ(counts, (std::set<std::size_t>{1, 2}));
}

TEST_F(Nav, AnEpisodeDependsOnItsNumberAlone) {
  start(5);
  const std::vector<double> qpos(data->qpos, data->qpos + model->nq);
  start(6);
  EXPECT_NE(qpos, std::vector<double>(data->qpos, data->qpos + model->nq));
  mj_resetData(model, data.get());
  task.sample(1, 5, state_row(data.get()));
  EXPECT_EQ(qpos, std::vector<double>(data->qpos, data->qpos + model->nq));
}

}  // namespace
}  // namespace mjsense
