// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/pick/pick.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/episode/testing/played_task.h"

namespace mjsense::tasks {
namespace {

using ::testing::HasSubstr;

episode::TaskCfg franka_at_table() { return episode::task_cfg("franka", "table"); }

struct Pick : ::testing::Test, episode::PlayedTask<PickTask> {
  Pick() : PlayedTask(3, franka_at_table()) {}
  int body() const { return task.objects(world.id)[0].body; }
  double* object_qpos() { return qpos_of(body()); }
};

TEST_F(Pick, EpisodeDependsOnItsNumberOnly) {
  start(5);
  const std::vector<double> before = qpos();
  const std::string what = task.description(0);
  start(6, 2);
  EXPECT_NE(before, qpos());
  start(5, 2);
  EXPECT_EQ(before, qpos());
  EXPECT_EQ(what, task.description(2));
}

TEST_F(Pick, ObjectsStartOnTheTableWithoutCollision) {
  std::set<std::string> targets;
  for (int episode = 0; episode < 100; ++episode) {
    start(episode);
    targets.insert(task.description(0));
    for (int i = 0; i < data->ncon; ++i) EXPECT_GT(data->contact[i].dist, -1e-4) << episode;
    const auto objects = task.all_objects();
    std::vector<double> radius;
    for (const auto& object : objects) {
      const Quat q = quat(data->xquat + 4 * object.body);
      double low = 1, r = 0;
      for (Vec3 point : object.shape.points) {
        const Vec3 p = rotate(q, point);
        low = std::min(low, p.z);
        r = std::max(r, std::hypot(p.x, p.y));
      }
      EXPECT_NEAR(data->xpos[3 * object.body + 2] + low, task.support_height(0), 1e-3);
      for (std::size_t other = 0; other < radius.size(); ++other) {
        const double *a = data->xpos + 3 * object.body, *b = data->xpos + 3 * objects[other].body;
        EXPECT_GT(std::hypot(a[0] - b[0], a[1] - b[1]), r + radius[other])
            << object.kind << " " << objects[other].kind << " " << episode;
      }
      radius.push_back(r);
    }
  }
  EXPECT_EQ(targets.size(), task.all_objects().size()) << "every kind is a target in 100 episodes";
}

TEST_F(Pick, ObjectsStayWhereTheyStart) {
  for (int episode = 0; episode < 3; ++episode) {
    start(episode);
    const std::vector<double> before(data->xpos, data->xpos + 3 * model->nbody);
    for (int i = 0; i < 500; ++i) mj_step(model, data.get());
    for (const auto& object : task.all_objects()) {
      for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(data->xpos[3 * object.body + k], before[3 * object.body + k], 2e-3)
            << object.kind;
    }
  }
}

TEST_F(Pick, LiftWithoutTheRobotIsNotSuccess) {
  start(1);
  episode::Evaluation e = task.evaluate(world);
  EXPECT_EQ(e.reward, 0);
  EXPECT_FALSE(e.success || e.terminal || e.truncated);
  object_qpos()[2] += 0.05;
  mj_forward(model, data.get());
  e = task.evaluate(world);
  EXPECT_NEAR(e.reward, 0.05, 1e-9);  // no other body supports it
  EXPECT_FALSE(e.success);            // but the robot does not touch it
}

TEST_F(Pick, LyingOnAnotherObjectIsNotSuccess) {
  start(0);
  for (int episode = 1; task.all_objects()[task.target(0)].kind != "blue_cube"; ++episode)
    start(episode);
  // On top of another object: high enough, but not held by the robot.
  const int target = task.target(0);
  const auto& other = task.all_objects()[0];
  ASSERT_EQ(other.kind, "red_block");
  const Quat turned = quat(data->xquat + 4 * other.body);
  const double* at = data->xpos + 3 * other.body;
  double top = 0;
  for (Vec3 point : other.shape.points) top = std::max(top, at[2] + rotate(turned, point).z);
  write_vec({at[0], at[1], top - 0.0005 - task.all_objects()[target].shape.low}, object_qpos());
  write_quat({}, object_qpos() + 3);
  mj_forward(model, data.get());
  const episode::Evaluation e = task.evaluate(world);
  EXPECT_FALSE(e.success);
  EXPECT_EQ(e.reward, 0) << "the other object bears it";
}

// An object counts as lifted only if the robot touches it and nothing else does.
TEST_F(Pick, SuccessRequiresContactWithTheRobotOnly) {
  start(1);
  const int target = task.target(0);
  // Move the object onto a colliding part of the gripper.
  const int gripper = scene::resolve(model, mjOBJ_BODY, "robot_0/gripper/base", "test");
  const double* g = data->xpos + 3 * gripper;
  write_vec({g[0], g[1], g[2]}, object_qpos());
  mj_forward(model, data.get());
  ASSERT_GT(data->ncon, 0);
  EXPECT_TRUE(task.evaluate(world).success);
  EXPECT_FALSE(task.evaluate(world).terminal) << "success ends an episode only if asked";

  // Another object touches it: no success, although the robot still touches it.
  const auto& other = task.all_objects()[target == 0 ? 1 : 0];
  double* q = qpos_of(other.body);
  const Vec3 before = vec3(q);
  const Vec3 far = task.all_objects()[target].shape.points.front();
  write_vec(Vec3{g[0], g[1], g[2]} + 1.2 * far, q);
  mj_forward(model, data.get());
  bool touching = false;
  for (int i = 0; i < data->ncon; ++i) {
    const int a = model->geom_bodyid[data->contact[i].geom[0]],
              b = model->geom_bodyid[data->contact[i].geom[1]];
    touching |= (a == other.body && b == body()) || (b == other.body && a == body());
  }
  ASSERT_TRUE(touching);
  EXPECT_FALSE(task.evaluate(world).success);
  EXPECT_EQ(task.evaluate(world).missing, "something other than the robot touches the object");
  write_vec(before, q);
  mj_forward(model, data.get());
  EXPECT_TRUE(task.evaluate(world).success);
}

// Success begins at a lift of one centimeter.
TEST_F(Pick, SuccessStartsAtALiftOfOneCentimetre) {
  start(1);
  const int gripper = scene::resolve(model, mjOBJ_BODY, "robot_0/gripper/base", "test");
  write_vec(vec3(data->xpos + 3 * gripper), object_qpos());
  mj_forward(model, data.get());
  task.begin(world);  // the episode starts here
  const double z = object_qpos()[2];
  for (const auto& [up, success] :
       {std::pair{0.0, false}, {0.0095, false}, {0.0105, true}, {-0.02, false}}) {
    object_qpos()[2] = z + up;
    mj_forward(model, data.get());
    EXPECT_EQ(task.evaluate(world).success, success) << up;
    EXPECT_EQ(task.evaluate(world).missing, success ? "" : "the object is not lifted");
  }
}

// The target has 7 cm of free space around it for an open gripper; other objects are 2 cm apart.
TEST_F(Pick, TargetHasFreeSpaceAroundIt) {
  double min_target = 1, min_other = 1;
  int tight = 0;
  constexpr int kEpisodes = 200;
  for (int episode = 0; episode < kEpisodes; ++episode) {
    start(episode);
    const auto objects = task.all_objects();
    const int target = task.target(0);
    const double* t = data->xpos + 3 * objects[target].body;
    EXPECT_TRUE(t[0] >= 0.42 && t[0] <= 0.66 && std::abs(t[1]) <= 0.25)
        << "where the arm reaches it";
    std::vector<double> radius;
    for (const auto& object : objects) {
      double r = 0;
      const Quat q = quat(data->xquat + 4 * object.body);
      for (Vec3 point : object.shape.points) {
        const Vec3 p = rotate(q, point);
        r = std::max(r, std::hypot(p.x, p.y));
      }
      radius.push_back(r);
    }
    double here = 1;
    for (std::size_t a = 0; a < objects.size(); ++a)
      for (std::size_t b = 0; b < a; ++b) {
        const double *p = data->xpos + 3 * objects[a].body, *q = data->xpos + 3 * objects[b].body;
        const double gap = std::hypot(p[0] - q[0], p[1] - q[1]) - radius[a] - radius[b];
        const bool of_target = static_cast<int>(a) == target || static_cast<int>(b) == target;
        (of_target ? min_target : min_other) = std::min(of_target ? min_target : min_other, gap);
        if (of_target) here = std::min(here, gap);
      }
    tight += here < 0.07 - 1e-9;
  }
  EXPECT_EQ(tight, 0);
  EXPECT_GE(min_target, 0.07 - 1e-9);
  EXPECT_LT(min_target, 0.08);  // the required distance is not larger
  EXPECT_GE(min_other, 0.02 - 1e-9);
  EXPECT_LT(min_other, 0.03);
}

// Blocks rest on each of their three kinds of faces equally often.
TEST_F(Pick, BlocksRestOnEveryKindOfFace) {
  int paths[3] = {};
  for (int episode = 0; episode < 150; ++episode) {
    start(episode);
    for (const auto& object : task.all_objects()) {
      if (object.kind != "red_block") continue;
      const Quat q = quat(data->xquat + 4 * object.body);
      const double up[3] = {rotate(q, {1, 0, 0}).z, rotate(q, {0, 1, 0}).z, rotate(q, {0, 0, 1}).z};
      for (int k = 0; k < 3; ++k) paths[k] += std::abs(up[k]) > 0.99;
    }
  }
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(paths[k], 50, 25) << k;
}

TEST_F(Pick, EndsAtTheHorizonOrWithADoneAction) {
  start(0);
  robots::Action action;
  for (int i = 0; i < task.cfg().horizon - 1; ++i)
    task.apply(world, action, robots::state_row(data.get()));
  EXPECT_FALSE(task.evaluate(world).truncated);
  task.apply(world, action, robots::state_row(data.get()));
  EXPECT_TRUE(task.evaluate(world).truncated);
  EXPECT_FALSE(task.evaluate(world).terminal);
  action.done = true;
  task.apply(world, action, robots::state_row(data.get()));
  EXPECT_TRUE(task.evaluate(world).terminal);
  start(1);
  EXPECT_FALSE(task.evaluate(world).terminal) << "a new episode";
  EXPECT_EQ(task.last_action(0), nullptr);
}

// Action noise differs between episodes and between steps, but not between worlds: the same state
// and command in another world gives the same noise.
TEST_F(Pick, ActionNoiseDependsOnEpisodeAndStep) {
  start(5);
  const std::vector<double> before = qpos();
  const int arm = task.robot().arm();
  robots::RobotValues now;
  task.robot().read_qpos(world, now);
  std::vector<double> target(now[arm].view().begin(), now[arm].view().end());
  for (double& q : target) q += 0.05;
  const auto noisy = [&](int id, std::int64_t episode, int step) {
    start(episode, id);
    std::ranges::copy(before, data->qpos);
    mj_forward(model, data.get());
    robots::Action action;
    action.commands[arm].set(target);
    for (int i = 0; i <= step; ++i) task.apply(world, action, robots::state_row(data.get()));
    return std::vector<double>(data->ctrl, data->ctrl + model->nu);
  };
  const std::vector<double> ctrl = noisy(0, 5, 0);
  EXPECT_EQ(ctrl, noisy(2, 5, 0));
  EXPECT_NE(ctrl, noisy(0, 6, 0));
  EXPECT_NE(ctrl, noisy(0, 5, 1));
}

TEST_F(Pick, ObsSceneDescribesTheTask) {
  start(3, 1);
  const auto obs = nlohmann::json::parse(task.obs_scene(1));
  EXPECT_EQ(obs["task_type"], "pick");
  EXPECT_EQ(obs["policy_dt_ms"], 66);
  EXPECT_EQ(obs["task_description"], task.description(1));
  EXPECT_EQ("Pick up the " + obs["object_name"].get<std::string>(), task.description(1));
  double probability = 0;
  for (const auto& pair : obs["referral_expressions"]["pickup_obj_name"])
    probability += pair[1].get<double>();
  EXPECT_NEAR(probability, 1, 1e-12);

  const auto info = this->info();
  EXPECT_NEAR(info["position_error"].get<double>(), 0.05, 1e-9);
  EXPECT_NEAR(info["rotation_error"].get<double>(), 0, 1e-6);
  EXPECT_EQ(info["success"], false);
  EXPECT_EQ(info["episode_step"], 0);
}

TEST_F(Pick, GoalIsFiveCentimetresAboveTheStart) {
  start(2);
  const Pose start_pose = task.start_pose(0, "pickup_obj");
  EXPECT_NEAR(start_pose.p.z, data->xpos[3 * body() + 2], 1e-12);
  EXPECT_NEAR(task.goal_pose(0, "pickup_obj")->p.z - start_pose.p.z, 0.05, 1e-12);
  EXPECT_THROW(task.start_pose(0, "place_receptacle"), KeyError);
}

TEST_F(Pick, SensorsAreInThePublishedOrder) {
  std::vector<std::string> names;
  for (const auto& sensor : task.create_task_sensors()) names.push_back(sensor->name());
  EXPECT_THAT(names, ::testing::ElementsAre("obj_start", "grasp_state_pickup_obj", "obj_end"));
  const auto robot_sensors = task.robot().create_robot_sensors();
  ASSERT_EQ(robot_sensors.size(), 1u);
  EXPECT_EQ(robot_sensors[0]->name(), "tcp_pose");
}

TEST(Task, InvalidConfigurationsThrow) {
  episode::TaskCfg cfg = franka_at_table();
  cfg.policy_dt_ms = 65;
  EXPECT_THROW(PickTask{cfg}, ValueError);
  cfg = franka_at_table();
  cfg.horizon = 0;
  EXPECT_THROW(PickTask{cfg}, ValueError);
}

}  // namespace
}  // namespace mjsense::tasks
