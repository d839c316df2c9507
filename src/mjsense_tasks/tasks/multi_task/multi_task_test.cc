// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/multi_task/multi_task.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/text/json.h"
#include "mjsense_tasks/episode/policy.h"
#include "mjsense_tasks/robots/load_robot.h"
#include "mjsense_tasks/tasks/door_opening/door_opening.h"
#include "mjsense_tasks/tasks/multi_task/nav_and_pick.h"
#include "mjsense_tasks/tasks/nav_to_obj/nav_to_obj.h"
#include "mjsense_tasks/tasks/opening/opening.h"
#include "mjsense_tasks/tasks/pick/pick.h"

namespace mjsense::tasks {
namespace {

using testing::HasSubstr;

episode::TaskCfg cfg(const std::string& scene) {
  episode::TaskCfg cfg;
  cfg.robot = robots::robot_cfg("rby1");
  cfg.scene = scene;
  return cfg;
}

std::unique_ptr<MultiTask> door_or_pick() {
  std::vector<std::unique_ptr<episode::Task>> children;
  children.push_back(std::make_unique<DoorOpeningTask>(cfg("room_with_door")));
  children.push_back(std::make_unique<PickTask>(cfg("room_with_door")));
  children.push_back(std::make_unique<PickTask>(cfg("room_with_door")));
  return std::make_unique<MultiTask>("door_or_pick", cfg("room_with_door"), std::move(children));
}

TEST(MultiTask, AnySuccessCountsAndTheRewardIsTheMaximum) {
  const auto task = door_or_pick();
  scene::Scene scene(task->scene_cfg_with_robot());
  const mjModel* model = scene.model();
  task->initialize(model, 2);
  const DataPtr data = make_data(model);
  for (int world = 0; world < 2; ++world) {
    mj_resetData(model, data.get());
    task->sample(world, 4, robots::state_row(data.get()));
    mj_forward(model, data.get());
    const World w{.id = world, .model = model, .data = data.get()};
    task->begin(w);
    const episode::Evaluation none = task->evaluate(w);
    EXPECT_FALSE(none.success);
    EXPECT_EQ(none.reward, 0);
    EXPECT_EQ(task->description(world), task->child(0).description(world) + " OR " +
                                            task->child(1).description(world) + " OR " +
                                            task->child(2).description(world));

    // The second child's object is in the air without a grasp: it gives a reward but no success.
    const int body = task->child(1).objects(world)[0].body;
    data->qpos[model->jnt_qposadr[model->body_jntadr[body]] + 2] += 0.3;
    mj_forward(model, data.get());
    EXPECT_NEAR(task->evaluate(w).reward, 0.3, 1e-6);
    EXPECT_FALSE(task->evaluate(w).success);

    const auto& door = static_cast<DoorOpeningTask&>(task->child(0)).door(world);
    data->qpos[model->jnt_qposadr[door.joint]] = door.open;
    mj_forward(model, data.get());
    EXPECT_TRUE(task->evaluate(w).success);
    EXPECT_EQ(task->evaluate(w).reward, 1);

    std::vector<std::uint8_t> row(2000);
    JsonWriter json(row);
    json.begin_object();
    task->write_info(w, json);
    json.end_object();
    ASSERT_TRUE(json.finish());
    const auto info = nlohmann::json::parse(reinterpret_cast<const char*>(row.data()));
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
  const auto task = door_or_pick();
  scene::Scene scene(task->scene_cfg_with_robot());
  task->initialize(scene.model(), 1);
  Counting policy, other;
  task->register_policy(policy);
  EXPECT_EQ(policy.count, 1);
  EXPECT_EQ(policy.of, task.get());
  EXPECT_THROW(task->child(1).register_policy(other), ValueError);

  const DataPtr data = make_data(scene.model());
  const robots::StateRow state = robots::state_row(data.get());
  task->reseed(5);
  task->sample(0, 7, state);
  mj_forward(scene.model(), data.get());
  const World w{.id = 0, .model = scene.model(), .data = data.get()};
  task->begin(w);
  robots::Action action;
  action.done = true;
  task->apply(w, action, state);
  for (int i = 0; i < task->size(); ++i) {
    const episode::Task& part = task->child(i);
    EXPECT_EQ(part.policy(), &policy);
    EXPECT_EQ(&part.robot(), &task->robot());
    EXPECT_EQ(part.cfg().seed, 5u);
    EXPECT_EQ(part.episode(0), 7);
    EXPECT_EQ(part.episode_step(0), 1);
    EXPECT_TRUE(part.evaluate(w).terminal);
  }
  EXPECT_TRUE(task->evaluate(w).terminal);
}

TEST(MultiTask, CombinesRolesSensorsAndLacks) {
  const auto task = door_or_pick();
  scene::Scene scene(task->scene_cfg_with_robot());
  task->initialize(scene.model(), 1);
  std::vector<std::string> roles, sensors, expected;
  for (const episode::TaskObject& object : task->objects(0)) roles.push_back(object.role);
  EXPECT_EQ(roles, (std::vector<std::string>{std::string(DoorOpeningTask::kRole),
                                             std::string(PickTask::kRole)}));
  for (int i = 0; i < 2; ++i) {
    for (const auto& sensor : task->child(i).create_task_sensors())
      expected.push_back(sensor->name());
  }
  for (const auto& sensor : task->create_task_sensors()) sensors.push_back(sensor->name());
  EXPECT_EQ(sensors, expected);
  EXPECT_EQ(task->grasp_scene(), task->child(1).grasp_scene());
  const DataPtr data = make_data(scene.model());
  task->sample(0, 1, robots::state_row(data.get()));
  mj_forward(scene.model(), data.get());
  task->begin({.id = 0, .model = scene.model(), .data = data.get()});
  EXPECT_EQ(task->objects(0)[1].body, task->child(1).objects(0)[0].body);
  const int body = task->objects(0)[1].body;
  EXPECT_EQ(task->start_pose(0, PickTask::kRole).p.z, data->xpos[3 * body + 2]);
  EXPECT_THROW(task->start_pose(0, "nothing"), KeyError);
}

TEST(MultiTask, FirstTaskSamplesTheSameEpisodeAsAlone) {
  std::vector<std::vector<double>> starts;
  for (const bool alone : {true, false}) {
    std::unique_ptr<episode::Task> task = std::make_unique<PickTask>(cfg("table"));
    if (!alone) {
      std::vector<std::unique_ptr<episode::Task>> children;
      children.push_back(std::move(task));
      children.push_back(std::make_unique<PickTask>(cfg("table")));
      task = std::make_unique<MultiTask>("multi_task", cfg("table"), std::move(children));
    }
    scene::Scene scene(task->scene_cfg_with_robot());
    task->initialize(scene.model(), 1);
    const DataPtr data = make_data(scene.model());
    task->sample(0, 3, robots::state_row(data.get()));
    starts.emplace_back(data->qpos, data->qpos + scene.model()->nq);
  }
  EXPECT_EQ(starts[0], starts[1]);
}

TEST(MultiTask, OtherTasksChooseGoalsInTheSceneOfTheFirst) {
  std::vector<std::unique_ptr<episode::Task>> children;
  children.push_back(std::make_unique<NavToObjTask>(cfg("floor")));
  children.push_back(std::make_unique<PickTask>(cfg("floor")));
  MultiTask task("multi_task", cfg("floor"), std::move(children));
  scene::Scene scene(task.scene_cfg_with_robot());
  const mjModel* model = scene.model();
  task.initialize(model, 1);
  const DataPtr data = make_data(model);
  std::set<int> bodies;
  for (int episode = 0; episode < 10; ++episode) {
    mj_resetData(model, data.get());
    task.sample(0, episode, robots::state_row(data.get()));
    mj_forward(model, data.get());
    const int body = task.child(1).objects(0)[0].body;
    EXPECT_LT(data->xpos[3 * body + 1], 50) << "it is there";
    bodies.insert(body);
  }
  EXPECT_GT(bodies.size(), 2u);
}

TEST(MultiTask, NavAndPickConcernsOneObjectAndSucceedsIfItIsPicked) {
  episode::TaskCfg mobile = cfg("floor");
  mobile.robot = robots::robot_cfg("mobile_franka");
  NavAndPickTask task(mobile);
  scene::Scene scene(task.scene_cfg_with_robot());
  const mjModel* model = scene.model();
  task.initialize(model, 1);
  const DataPtr data = make_data(model);
  const World w{.id = 0, .model = model, .data = data.get()};
  std::set<int> bodies;
  for (int episode = 0; episode < 4; ++episode) {
    mj_resetData(model, data.get());
    task.sample(0, episode, robots::state_row(data.get()));
    mj_forward(model, data.get());
    task.begin(w);
    const int body = task.child(0).objects(0)[0].body;
    bodies.insert(body);
    ASSERT_EQ(task.objects(0).size(), 1u);
    EXPECT_EQ(task.child(1).objects(0)[0].body, body);
    EXPECT_THAT(task.description(0), HasSubstr(" and pick it up"));
    EXPECT_THAT(task.instruction(0), HasSubstr(" it")) << task.instruction(0);

    // Next to the object, which hangs in the air without a grasp.
    const auto& nav = static_cast<const NavToObjTask&>(task.child(0));
    data->qpos[model->jnt_qposadr[model->body_jntadr[body]] + 2] += 0.3;
    mj_forward(model, data.get());
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
  std::vector<std::unique_ptr<episode::Task>> one, two;
  one.push_back(std::make_unique<PickTask>(cfg("floor")));
  EXPECT_THAT(message(std::move(one)), HasSubstr("1 task, at least two"));
  two.push_back(std::make_unique<PickTask>(cfg("floor")));
  two.push_back(std::make_unique<PickTask>(cfg("table")));
  EXPECT_THAT(message(std::move(two)), HasSubstr("has scene 'table'"));
}

TEST(MultiTask, TaskThatChangesTheSceneMustBeFirst) {
  std::vector<std::unique_ptr<episode::Task>> children;
  children.push_back(std::make_unique<PickTask>(cfg("kitchen")));
  children.push_back(std::make_unique<OpeningTask>(cfg("kitchen"), OpeningKind::kOpen));
  MultiTask task("pick+open", cfg("kitchen"), std::move(children));
  scene::Scene scene(task.scene_cfg_with_robot());
  task.initialize(scene.model(), 1);
  const DataPtr data = make_data(scene.model());
  EXPECT_THAT(error_of<ValueError>([&] { task.sample(0, 0, robots::state_row(data.get())); }),
              HasSubstr("task 'open' cannot choose its goal"));
}

}  // namespace
}  // namespace mjsense::tasks
