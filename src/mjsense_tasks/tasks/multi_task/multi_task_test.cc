// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/multi_task/multi_task.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense_tasks/episode/policy.h"
#include "mjsense_tasks/episode/testing/played_task.h"
#include "mjsense_tasks/tasks/door_opening/door_opening.h"
#include "mjsense_tasks/tasks/multi_task/nav_and_pick.h"
#include "mjsense_tasks/tasks/nav_to_obj/nav_to_obj.h"
#include "mjsense_tasks/tasks/opening/opening.h"
#include "mjsense_tasks/tasks/pick/pick.h"

namespace mjsense::tasks {
namespace {

using ::testing::HasSubstr;

episode::TaskCfg cfg(const std::string& scene) { return episode::task_cfg("rby1", scene); }

template <class... Tasks>
std::vector<std::unique_ptr<episode::Task>> children(std::unique_ptr<Tasks>... tasks) {
  std::vector<std::unique_ptr<episode::Task>> all;
  (all.push_back(std::move(tasks)), ...);
  return all;
}

std::unique_ptr<PickTask> pick(const char* scene) { return std::make_unique<PickTask>(cfg(scene)); }

struct DoorOrPick : episode::PlayedTask<MultiTask> {
  explicit DoorOrPick(int num_worlds = 1)
      : PlayedTask(num_worlds, "door_or_pick", cfg("room_with_door"),
                   children(std::make_unique<DoorOpeningTask>(cfg("room_with_door")),
                            pick("room_with_door"), pick("room_with_door"))) {}
};

TEST(MultiTask, AnySuccessCountsAndTheRewardIsTheMaximum) {
  DoorOrPick played(2);
  MultiTask& task = played.task;
  for (int world = 0; world < 2; ++world) {
    const World w = played.start(4, world);
    const episode::Evaluation none = task.evaluate(w);
    EXPECT_FALSE(none.success);
    EXPECT_EQ(none.reward, 0);
    EXPECT_EQ(task.description(world), task.child(0).description(world) + " OR " +
                                           task.child(1).description(world) + " OR " +
                                           task.child(2).description(world));

    // The second child's object is in the air without a grasp: it gives a reward but no success.
    played.qpos_of(task.child(1).objects(world)[0].body)[2] += 0.3;
    mj_forward(w.model, w.data);
    EXPECT_NEAR(task.evaluate(w).reward, 0.3, 1e-6);
    EXPECT_FALSE(task.evaluate(w).success);

    const auto& door = static_cast<DoorOpeningTask&>(task.child(0)).door(world);
    w.data->qpos[w.model->jnt_qposadr[door.joint]] = door.open;
    mj_forward(w.model, w.data);
    EXPECT_TRUE(task.evaluate(w).success);
    EXPECT_EQ(task.evaluate(w).reward, 1);

    const auto info = played.info();
    EXPECT_TRUE(info["success"].get<bool>());
    EXPECT_TRUE(info["tasks"]["door_opening"]["success"].get<bool>());
    EXPECT_FALSE(info["tasks"]["pick"]["success"].get<bool>());
    EXPECT_EQ(info["tasks"].size(), 3u) << "pick_2";
  }
}

struct Counting final : episode::Policy {
  std::string_view name() const override { return "counting"; }
  void initialize(episode::Task& task) override {
    ++count;
    of = &task;
  }
  int count = 0;
  const episode::Task* of = nullptr;
};

TEST(MultiTask, ChildrenShareRobotPolicyAndEpisode) {
  DoorOrPick played;
  MultiTask& task = played.task;
  Counting policy, other;
  task.register_policy(policy);
  EXPECT_EQ(policy.count, 1);
  EXPECT_EQ(policy.of, &task);
  EXPECT_THROW(task.child(1).register_policy(other), ValueError);

  task.reseed(5);
  const World w = played.start(7);
  robots::Action action;
  action.done = true;
  task.apply(w, action, robots::state_row(w.data));
  for (int i = 0; i < task.size(); ++i) {
    const episode::Task& part = task.child(i);
    EXPECT_EQ(part.policy(), &policy);
    EXPECT_EQ(&part.robot(), &task.robot());
    EXPECT_EQ(part.cfg().seed, 5u);
    EXPECT_EQ(part.episode(0), 7);
    EXPECT_EQ(part.episode_step(0), 1);
    EXPECT_TRUE(part.evaluate(w).terminal);
  }
  EXPECT_TRUE(task.evaluate(w).terminal);
}

TEST(MultiTask, CombinesRolesSensorsAndLacks) {
  DoorOrPick played;
  MultiTask& task = played.task;
  std::vector<std::string> roles, sensors, expected;
  for (const episode::TaskObject& object : task.objects(0)) roles.push_back(object.role);
  EXPECT_EQ(roles, (std::vector<std::string>{std::string(DoorOpeningTask::kRole),
                                             std::string(PickTask::kRole)}));
  for (int i = 0; i < 2; ++i) {
    for (const auto& sensor : task.child(i).create_task_sensors())
      expected.push_back(sensor->name());
  }
  for (const auto& sensor : task.create_task_sensors()) sensors.push_back(sensor->name());
  EXPECT_EQ(sensors, expected);
  EXPECT_EQ(task.grasp_scene(), task.child(1).grasp_scene());
  played.start(1);
  const int body = task.objects(0)[1].body;
  EXPECT_EQ(body, task.child(1).objects(0)[0].body);
  EXPECT_EQ(task.start_pose(0, PickTask::kRole).p.z, played.data->xpos[3 * body + 2]);
  EXPECT_THROW(task.start_pose(0, "nothing"), KeyError);
}

TEST(MultiTask, FirstTaskSamplesTheSameEpisodeAsAlone) {
  episode::PlayedTask<PickTask> alone(1, cfg("table"));
  episode::PlayedTask<MultiTask> both(1, "multi_task", cfg("table"),
                                      children(pick("table"), pick("table")));
  alone.start(3);
  both.start(3);
  EXPECT_EQ(alone.qpos(), both.qpos());
}

TEST(MultiTask, OtherTasksChooseGoalsInTheSceneOfTheFirst) {
  episode::PlayedTask<MultiTask> played(
      1, "multi_task", cfg("floor"),
      children(std::make_unique<NavToObjTask>(cfg("floor")), pick("floor")));
  std::set<int> bodies;
  for (int episode = 0; episode < 10; ++episode) {
    played.start(episode);
    const int body = played.task.child(1).objects(0)[0].body;
    EXPECT_LT(played.data->xpos[3 * body + 1], 50) << "it is there";
    bodies.insert(body);
  }
  EXPECT_GT(bodies.size(), 2u);
}

TEST(MultiTask, NavAndPickConcernsOneObjectAndSucceedsIfItIsPicked) {
  episode::PlayedTask<NavAndPickTask> played(1, episode::task_cfg("mobile_franka", "floor"));
  NavAndPickTask& task = played.task;
  std::set<int> bodies;
  for (int episode = 0; episode < 4; ++episode) {
    const World w = played.start(episode);
    const int body = task.child(0).objects(0)[0].body;
    bodies.insert(body);
    ASSERT_EQ(task.objects(0).size(), 1u);
    EXPECT_EQ(task.child(1).objects(0)[0].body, body);
    EXPECT_THAT(task.description(0), HasSubstr(" and pick it up"));
    EXPECT_THAT(task.instruction(0), HasSubstr(" it")) << task.instruction(0);

    // Next to the object, which hangs in the air without a grasp.
    const auto& nav = static_cast<const NavToObjTask&>(task.child(0));
    played.qpos_of(body)[2] += 0.3;
    mj_forward(w.model, w.data);
    const double drive = nav.evaluate(w).reward;
    EXPECT_NEAR(task.evaluate(w).reward, drive + 0.3, 1e-6);
    EXPECT_FALSE(task.evaluate(w).success) << "the robot does not hold it";
  }
  EXPECT_GT(bodies.size(), 1u);
}

TEST(MultiTask, InvalidCombinationsThrow) {
  const auto message = [](std::vector<std::unique_ptr<episode::Task>> children) -> std::string {
    return error_of<ValueError>(
        [&] { MultiTask task("multi_task", cfg("floor"), std::move(children)); });
  };
  EXPECT_THAT(message(children(pick("floor"))), HasSubstr("1 task, at least two"));
  EXPECT_THAT(message(children(pick("floor"), pick("table"))), HasSubstr("has scene 'table'"));
}

TEST(MultiTask, TaskThatChangesTheSceneMustBeFirst) {
  episode::PlayedTask<MultiTask> played(
      1, "pick+open", cfg("kitchen"),
      children(pick("kitchen"), std::make_unique<OpeningTask>(cfg("kitchen"), OpeningKind::kOpen)));
  EXPECT_THAT(error_of<ValueError>([&] { played.start(0); }),
              HasSubstr("task 'open' cannot choose its goal"));
}

}  // namespace
}  // namespace mjsense::tasks
