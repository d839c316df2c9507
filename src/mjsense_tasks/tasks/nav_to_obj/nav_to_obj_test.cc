// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/nav_to_obj/nav_to_obj.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "mjsense_tasks/episode/testing/played_task.h"

namespace mjsense::tasks {
namespace {

std::string last_part(const std::string& name) { return name.substr(name.rfind('/') + 1); }

struct Nav : ::testing::Test, episode::PlayedTask<NavToObjTask> {
  Nav() : PlayedTask(2, episode::task_cfg("rby1")) {}
  // Places the robot at a distance (m) from its target, turned away from it by `turned` (rad).
  // False if no placement is free. Facing the target, the robot must also see it.
  bool stand(double distance, double turned) {
    const double* at = data->xpos + 3 * task.objects(0)[0].body;
    const Vec3 target = vec3(at);
    const auto& base = task.robot().group("base").qpos;
    // Try directions all around the target until a placement is free.
    for (int k = 0; k < 36; ++k) {
      const double a = k * 3.14159265 / 18;
      const scenes::BasePose p{target.x - distance * std::cos(a), target.y - distance * std::sin(a),
                               a + turned};
      data->qpos[base[0]] = p.x;
      data->qpos[base[1]] = p.y;
      data->qpos[base[2]] = p.yaw;
      mj_forward(model, data.get());
      if (task.routes()->free(p) && (turned != 0 || task.sees(world, task.camera_pose(world))))
        return true;
    }
    return false;
  }
};

TEST_F(Nav, RewardDecreasesWithTheDistanceOfTheVisibleObject) {
  int tested = 0;
  for (int episode = 0; episode < 16 && tested < 3; ++episode) {
    start(episode);
    EXPECT_EQ(task.evaluate(world).missing, "the object is too far away");
    if (!stand(1.25, 0)) continue;
    const episode::Evaluation e = task.evaluate(world);
    EXPECT_NEAR(e.reward, 1 - 1.25 / 1.5, 1e-6);
    EXPECT_TRUE(e.success);
    EXPECT_EQ(e.missing, "");
    ASSERT_TRUE(stand(1.25, 3.14159265));
    EXPECT_EQ(task.evaluate(world).reward, 0) << "behind its back";
    EXPECT_EQ(task.evaluate(world).missing, "the camera does not see the object");
    ++tested;
  }
  EXPECT_EQ(tested, 3);
}

// A start is rejected if the target is not visible from any base pose.
TEST_F(Nav, StartWithoutAViewOfTheTargetIsRejected) {
  start(0);
  EXPECT_EQ(task.start_error(world), "");
  const int body = task.objects(0)[0].body;
  data->qpos[model->jnt_qposadr[model->body_jntadr[body]] + 2] = 10;  // above the ceiling
  mj_forward(model, data.get());
  EXPECT_EQ(task.start_error(world), "task 'nav_to_obj': robot 'rby1' cannot see the " +
                                         task.objects(0)[0].name +
                                         " in scene 'floor' from any base pose that it can reach");
}

TEST_F(Nav, OccludedObjectsAreNotVisible) {
  start(0);
  ASSERT_TRUE(stand(1.2, 0));
  const int body = task.objects(0)[0].body;
  double* qpos = data->qpos + model->jnt_qposadr[model->body_jntadr[body]];
  const Pose camera = task.camera_pose(world);
  ASSERT_TRUE(task.sees(world, camera));
  qpos[2] = 10;  // above the ceiling
  mj_forward(model, data.get());
  EXPECT_FALSE(task.sees(world, camera));
  // In front of the camera.
  write_vec(camera * Vec3{0, 0, -0.4}, qpos);
  mj_forward(model, data.get());
  EXPECT_TRUE(task.sees(world, camera));
  write_vec(camera * Vec3{0, 0, 0.4}, qpos);  // behind it
  mj_forward(model, data.get());
  EXPECT_FALSE(task.sees(world, camera));
}

// The text, the labels and the evaluation refer to one body, and no other object of the episode has
// its name. The floor scene has two mugs, which are both present in some episodes.
TEST_F(Nav, TargetHasAUniqueName) {
  int pairs = 0;
  std::set<std::string> named;
  for (int episode = 0; episode < 40; ++episode) {
    start(episode);
    const episode::TaskObject& target = task.objects(0)[0];
    EXPECT_EQ(task.description(0), "Navigate to the " + target.name);
    EXPECT_EQ(task.start_error(world), "");
    named.insert(target.name);
    std::map<std::string, int> there;  // present objects by the last part of their body names
    for (int body = 1; body < model->nbody; ++body) {
      if (task.present(0, body) && model->body_dofnum[body] == 6)
        ++there[last_part(mj_id2name(model, mjOBJ_BODY, body))];
    }
    EXPECT_EQ(there[last_part(mj_id2name(model, mjOBJ_BODY, target.body))], 1);
    pairs += std::ranges::count_if(there, [](const auto& kind) { return kind.second > 1; }) > 0;
    const Pose base = task.robot().base_pose(world);
    const double* at = data->xpos + 3 * target.body;
    EXPECT_EQ(task.distance(world, base.p.x, base.p.y),
              std::hypot(at[0] - base.p.x, at[1] - base.p.y));
  }
  EXPECT_GT(pairs, 5);
  EXPECT_GT(named.size(), 5u);
}

// The labelled object is evaluated even if another object is closer and visible.
TEST_F(Nav, OtherObjectInFrontOfTheRobotIsNotSuccess) {
  start(0);
  ASSERT_TRUE(stand(1.2, 0));
  ASSERT_TRUE(task.evaluate(world).success);
  const int target = task.objects(0)[0].body;
  int other = 1;
  while (other == target || !task.present(0, other) || model->body_dofnum[other] != 6 ||
         model->body_rootid[other] != other)
    ++other;
  double* at = data->qpos + model->jnt_qposadr[model->body_jntadr[target]];
  std::copy_n(at, 3, data->qpos + model->jnt_qposadr[model->body_jntadr[other]]);
  at[2] = 10;  // above the ceiling
  mj_forward(model, data.get());
  EXPECT_FALSE(task.evaluate(world).success);
}

TEST_F(Nav, EpisodeDependsOnItsNumberOnly) {
  start(5);
  const std::vector<double> qpos(data->qpos, data->qpos + model->nq);
  start(6);
  EXPECT_NE(qpos, std::vector<double>(data->qpos, data->qpos + model->nq));
  mj_resetData(model, data.get());
  task.sample(1, 5, robots::state_row(data.get()));
  EXPECT_EQ(qpos, std::vector<double>(data->qpos, data->qpos + model->nq));
}

// The follower camera, like the discs of the robot's footprint, is clear of walls: no wall is
// between the middle of the robot and the camera, which is less than 0.35 m away horizontally.
TEST_F(Nav, FollowerCameraIsInsideTheHouse) {
  const int camera = mj_name2id(model, mjOBJ_CAMERA, "robot_0/camera_follower");
  ASSERT_GE(camera, 0);
  for (int episode = 0; episode < 40; ++episode) {
    start(episode);
    const Vec3 eye = vec3(data->cam_xpos + 3 * camera), base = task.robot().base_pose(world).p;
    EXPECT_LT(std::hypot(eye.x - base.x, eye.y - base.y), 0.35);
    double from[3], to[3];
    write_vec({base.x, base.y, eye.z}, from);
    write_vec(eye - Vec3{base.x, base.y, eye.z}, to);
    constexpr mjtByte kDrawn[mjNGROUP] = {1, 1, 1, 0, 0, 0};
    // A ray from above the head to the camera.
    const double wall = mj_ray(model, data.get(), from, to, kDrawn, 1, -1, nullptr, nullptr);
    EXPECT_TRUE(wall < 0 || wall > 1) << "episode " << episode;
  }
}

}  // namespace
}  // namespace mjsense::tasks
