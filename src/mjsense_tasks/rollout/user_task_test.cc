// SPDX-License-Identifier: Apache-2.0
// A user-defined task and policy in C++; docs/own_task.md shows parts of this file.

#include <gmock/gmock.h>

#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/observe/function_sensor.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense::tasks::rollout {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kCart = R"(
<mujoco>
  <worldbody>
    <body name="cart">
      <joint name="slide" type="slide" axis="1 0 0" range="-1 1" damping="20"/>
      <geom type="box" size=".05 .05 .05" mass="1"/>
    </body>
    <body name="ball" pos="0 1 0"><freejoint/><geom size=".02"/></body>
  </worldbody>
  <actuator><position name="drive" joint="slide" kp="100" ctrlrange="-1 1"/></actuator>
</mujoco>)";

// Drive a cart to a mark.
class CartTask final : public episode::Task {
 public:
  explicit CartTask(episode::TaskCfg cfg) : episode::Task(with_periods(std::move(cfg))) {}
  std::string_view name() const override { return "cart"; }
  std::string_view type() const override { return "cart"; }
  std::string robot_entity() const override { return "cart"; }

  scene::SceneCfg scene_cfg() const override {
    scene::EntityCfg cart;
    cart.model.xml = kCart;
    scene::SceneCfg scene;
    scene.entities = {{"cart", cart}};
    return scene;
  }
  episode::Evaluation evaluate(const World& world) const override {
    const double error = std::abs(world.data->qpos[0] - marks_[world.id]);
    const bool over = std::abs(world.data->qpos[0]) > 0.95;
    return make_evaluation(world.id, -error, error < 0.02, over);
  }
  void evaluate_all(episode::ActiveWorlds& worlds, std::span<episode::Evaluation> out) override {
    ++evaluations;
    episode::Task::evaluate_all(worlds, out);
  }

  std::span<const episode::TaskObject> objects(int) const override { return {}; }
  std::string description(int) const override { return "Drive the cart to the mark"; }
  Referrals referrals(int) const override { return {}; }
  Pose start_pose(int, std::string_view) const override { return {}; }
  std::optional<Pose> goal_pose(int, std::string_view) const override { return {}; }
  void write_info(const World& world, JsonWriter& json) const override {
    json.key("mark").value(marks_[world.id]);
  }
  std::vector<std::shared_ptr<Sensor>> create_task_sensors() const override {
    return {std::make_shared<observe::FunctionSensor<double>>(
        "mark", SensorSpec{.unit = "m"},
        [this](const World& world, std::span<double> row) { row[0] = marks_[world.id]; })};
  }
  std::string start_error(const World& world) const override {
    return world.data->qpos[0] < min_start ? "the cart starts on the left" : "";
  }
  void edit_suite(observe::SensorSuite& suite) const override {
    if (!keep.empty()) suite.select(keep);
  }

  double mark(int world) const { return marks_[world]; }
  int evaluations = 0, samples = 0;
  double min_start = -1;          // m, minimum distance of playable starts
  std::vector<std::string> keep;  // sensors of the suite to keep; empty: all

 protected:
  void initialize_task() override { marks_.assign(num_worlds(), 0.0); }
  std::optional<Pose> sample_scene(int world, Rng& rng, const robots::StateRow& state) override {
    ++samples;
    state.qpos[0] = rng.uniform(-0.5, 0.5);
    marks_[world] = rng.uniform(-0.5, 0.5);
    return {};
  }

 private:
  static episode::TaskCfg with_periods(episode::TaskCfg cfg) {
    cfg.policy_dt_ms = 20;
    return cfg;
  }
  std::vector<double> marks_;  // [B] m
};

// Acts for all worlds at once.
class Drive final : public episode::Policy {
 public:
  std::string_view name() const override { return "drive"; }
  void initialize(episode::Task& task) override { task_ = &dynamic_cast<CartTask&>(task); }
  void act_all(episode::ActiveWorlds& worlds, std::span<robots::Action> actions) override {
    ++acts;
    for (int w : worlds.ids()) {
      const double command[] = {task_->mark(w)};
      actions[w].commands[task_->robot().group_index("joints")].set(command);
    }
  }
  int acts = 0;

 private:
  CartTask* task_ = nullptr;
};

RolloutCfg two_worlds() {
  RolloutCfg cfg;
  cfg.num_worlds = 2;
  cfg.threads = 2;
  return cfg;
}

struct OwnTask : ::testing::Test {
  std::shared_ptr<CartTask> task = std::make_shared<CartTask>(episode::TaskCfg{});
  std::shared_ptr<Drive> policy = std::make_shared<Drive>();

  static void start(Rollout& rollout) {
    const int worlds[] = {0, 1};
    const std::int64_t episodes[] = {0, 1};
    rollout.start(worlds, episodes);
  }
  static double number(Rollout& rollout, const std::string& stream, int world) {
    return rollout.suite().stream(stream).data.row<double>(world)[0];
  }
  static double position(Rollout& rollout, int world) {
    return rollout.suite().stream("qpos/joints").data.row<float>(world)[0];
  }
  static bool given(Rollout& rollout, const std::string& action, int world) {
    return rollout.suite().stream(action + "/given/joints").data.row<bool>(world)[0];
  }
  static robots::Action command(const episode::Task& task, double x) {
    robots::Action action;
    action.commands[task.robot().group_index("joints")].set({&x, 1});
    return action;
  }
};

TEST_F(OwnTask, SceneContainsTheRobot) {
  Rollout rollout(two_worlds(), task, policy);
  EXPECT_THAT(rollout.suite().names(),
              ElementsAre("qpos", "qvel", "robot_base_pose", "env_states", "task_info",
                          "actions/commanded_action", "actions/joint_pos", "actions/joint_pos_rel",
                          "actions/ee_twist", "actions/ee_pose", "mark"));
  EXPECT_EQ(rollout.suite().owner("mark"), "task 'cart'");
  EXPECT_EQ(rollout.cfg().task, "cart");
  start(rollout);
  for (int t = 0; t < 100; ++t) {
    rollout.act();
    rollout.step();
  }
  for (int w = 0; w < 2; ++w) {
    EXPECT_TRUE(rollout.evaluation(w).success);
    EXPECT_EQ(number(rollout, "actions/joint_pos/joints", w), task->mark(w));
    EXPECT_EQ(number(rollout, "mark", w), task->mark(w));
  }
  EXPECT_NE(task->mark(0), task->mark(1));
}

TEST_F(OwnTask, RobotOfTheSceneIsTheDefault) {
  RolloutCfg cfg = two_worlds();
  cfg.policy = "";
  cfg.make_task = [](episode::TaskCfg wanted) {
    return std::make_unique<CartTask>(std::move(wanted));
  };
  ASSERT_EQ(cfg.robot, kTaskRobot);
  Rollout rollout(cfg);
  EXPECT_EQ(rollout.cfg().robot, "");
  EXPECT_EQ(rollout.simulation().worlds().model()->nu, 1);
  EXPECT_EQ(rollout.task().robot().group("joints").actuators.size(), 1u);
}

TEST_F(OwnTask, EvaluatesAndActsForAllWorldsAtOnce) {
  Rollout rollout(two_worlds(), task, policy);
  start(rollout);
  EXPECT_EQ(task->evaluations, 1);
  for (int t = 0; t < 5; ++t) {
    rollout.act();
    rollout.step();
  }
  EXPECT_EQ(task->evaluations, 6);
  EXPECT_EQ(policy->acts, 5);
}

TEST_F(OwnTask, RegisteredTaskHasAName) {
  register_task("cart",
                [](episode::TaskCfg cfg) { return std::make_unique<CartTask>(std::move(cfg)); });
  register_policy("drive", [] { return std::make_unique<Drive>(); });
  EXPECT_THAT(task_names(), ::testing::Contains("cart"));
  EXPECT_THAT(policy_names(), ::testing::Contains("drive"));
  RolloutCfg cfg = two_worlds();
  cfg.task = "cart";
  cfg.policy = "drive";
  cfg.robot = "";
  Rollout rollout(cfg);
  start(rollout);
  rollout.act();
  rollout.step();
  EXPECT_EQ(rollout.fault(0), "");
  EXPECT_EQ(error_of<ValueError>([&] { register_task("cart", nullptr); }),
            "a task named 'cart' is already registered");
  EXPECT_THROW(register_policy("planner", nullptr), ValueError);
  EXPECT_THROW(register_policy("", nullptr), ValueError);
}

TEST_F(OwnTask, PickNeedsARobot) {
  RolloutCfg cfg = two_worlds();
  cfg.robot = "";
  EXPECT_EQ(error_of<ValueError>([&] { Rollout rollout(cfg); }),
            "task 'pick' needs a robot, and none is given");
}

TEST_F(OwnTask, TaskMayEditTheSuite) {
  task->keep = {"mark", "qpos"};
  Rollout rollout(two_worlds(), task, policy);
  EXPECT_THAT(rollout.suite().names(), ElementsAre("mark", "qpos"));
  auto wrong = std::make_shared<CartTask>(episode::TaskCfg{});
  wrong->keep = {"qpo"};
  EXPECT_THAT(error_of<KeyError>([&] { Rollout other(two_worlds(), wrong, nullptr); }),
              HasSubstr("did you mean 'qpos'?"));
}

TEST_F(OwnTask, WithoutSensorsTheSuiteIsTheCallers) {
  RolloutCfg cfg = two_worlds();
  cfg.use_sensors = false;
  Rollout rollout(cfg, task, policy);
  EXPECT_EQ(rollout.suite().size(), 0u);
  start(rollout);
  rollout.act();
  rollout.step();
  EXPECT_LT(rollout.evaluation(0).reward, 0);
}

TEST_F(OwnTask, SuccessEndsAnEpisodeOnRequest) {
  episode::TaskCfg cfg;
  cfg.terminate_upon_success = true;
  auto needs_every_step = std::make_shared<CartTask>(cfg);
  Rollout rollout(two_worlds(), needs_every_step, policy);
  start(rollout);
  while (!rollout.evaluation(0).terminal) {
    EXPECT_TRUE(given(rollout, "actions/joint_pos", 0));
    rollout.act();
    rollout.step();
  }
  EXPECT_TRUE(rollout.evaluation(0).success);
  for (const char* name :
       {"actions/joint_pos", "actions/joint_pos_rel", "actions/ee_twist", "actions/ee_pose"}) {
    EXPECT_FALSE(given(rollout, name, 0)) << name;
  }
  EXPECT_EQ(number(rollout, "actions/joint_pos/joints", 0), 0);
  EXPECT_TRUE(given(rollout, "actions/commanded_action", 0));
}

// A chunk equals its single steps without the intermediate observations.
TEST_F(OwnTask, ChunkEqualsItsSteps) {
  Rollout single(two_worlds(), task, policy);
  auto other = std::make_shared<CartTask>(episode::TaskCfg{});
  Rollout chunked(two_worlds(), other, nullptr);
  start(single);
  start(chunked);
  std::vector<robots::Action> chunk;
  double reward[2] = {};
  for (int t = 0; t < 4; ++t) {
    for (int w = 0; w < 2; ++w) {
      chunk.push_back(command(*task, 0.1 * t - 0.2 * w));
      single.action(w) = chunk.back();
    }
    single.step();
    for (int w = 0; w < 2; ++w) reward[w] += single.evaluation(w).reward;
  }
  chunked.step_chunk(chunk);
  for (int w = 0; w < 2; ++w) {
    EXPECT_EQ(chunked.suite().stream("qpos/joints").data.row<float>(w)[0],
              single.suite().stream("qpos/joints").data.row<float>(w)[0]);
    EXPECT_DOUBLE_EQ(chunked.evaluation(w).reward, reward[w]);
    EXPECT_EQ(chunked.task().episode_step(w), 4);
  }
  EXPECT_THROW(chunked.step_chunk(std::span(chunk).first(3)), ValueError);
  EXPECT_THROW(chunked.step_chunk({}), ValueError);
}

TEST_F(OwnTask, ChunkEndsWithItsEpisode) {
  Rollout rollout(two_worlds(), task, nullptr);
  start(rollout);
  // World 0 drives out of the field, world 1 reaches its mark.
  std::vector<robots::Action> chunk;
  for (int t = 0; t < 200; ++t) {
    chunk.push_back(command(*task, 1.0));
    chunk.push_back(command(*task, task->mark(1)));
  }
  rollout.step_chunk(chunk, /*stop_on_success=*/true);
  EXPECT_TRUE(rollout.evaluation(0).terminal);
  EXPECT_LT(task->episode_step(0), 200);
  EXPECT_FALSE(given(rollout, "actions/joint_pos", 0));
  EXPECT_TRUE(rollout.evaluation(1).success);
  EXPECT_FALSE(rollout.evaluation(1).terminal);
  EXPECT_LT(task->episode_step(1), 200);
}

// A start that cannot be played is drawn again, with the same result in every world.
TEST_F(OwnTask, StartsAreDrawnUntilTheyCanBePlayed) {
  task->min_start = 0;
  RolloutCfg cfg = two_worlds();
  cfg.num_worlds = 8;
  Rollout many(cfg, task, nullptr);
  const int worlds[] = {7, 1, 2, 3, 4, 5, 6, 0};
  const std::int64_t episodes[] = {0, 1, 2, 3, 4, 5, 6, 7};
  many.start(worlds, episodes);
  auto other = std::make_shared<CartTask>(episode::TaskCfg{});
  other->min_start = 0;
  cfg.num_worlds = 1;
  Rollout one(cfg, other, nullptr);
  for (int k = 0; k < 8; ++k) {
    one.start(std::span(worlds).subspan(7, 1), std::span(episodes).subspan(k, 1));
    EXPECT_EQ(one.fault(0), "");
    EXPECT_GE(position(one, 0), 0);
    EXPECT_EQ(position(one, 0), position(many, worlds[k]));
    EXPECT_EQ(other->mark(0), task->mark(worlds[k]));
    EXPECT_EQ(many.simulation().worlds().time(worlds[k]), 0);
  }
  EXPECT_GT(other->samples, 8);
  other->min_start = 0.6;  // no start can be played
  one.start(std::span(worlds).subspan(7, 1), std::span(episodes).first(1));
  EXPECT_EQ(one.fault(0), "the cart starts on the left");
}

TEST_F(OwnTask, EpisodesDependOnTheSeed) {
  Rollout rollout(two_worlds(), task, policy);
  start(rollout);
  const double first = task->mark(0);
  rollout.reseed(5);
  EXPECT_FALSE(rollout.active(0));
  start(rollout);
  const double other = task->mark(0);
  EXPECT_NE(other, first);
  rollout.reseed(0);
  start(rollout);
  EXPECT_EQ(task->mark(0), first);
}

}  // namespace
}  // namespace mjsense::tasks::rollout
