// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/rollout.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/core/row_error.h"
#include "mjsense/core/testing/allocations.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/observe/function_sensor.h"
#include "mjsense/record/molmospaces.h"

namespace mjsense::tasks::rollout {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

RolloutCfg blind(int num_worlds = 1, int threads = 1) {
  RolloutCfg cfg;
  cfg.cameras.emplace();
  cfg.num_worlds = num_worlds;
  cfg.threads = threads;
  cfg.seed = 3;
  return cfg;
}

json row(Rollout& rollout, const std::string& name, int world = 0) {
  const auto bytes = rollout.suite().stream(name).data.row<std::uint8_t>(world);
  const std::string text(bytes.begin(), bytes.end());
  return json::parse(text.substr(0, text.find('\0')));
}

// Values of one stream in world 0.
template <class T = double>
std::vector<double> numbers(Rollout& rollout, const std::string& stream) {
  const auto row = rollout.suite().stream(stream).data.row<T>(0);
  return {row.begin(), row.end()};
}

bool given(Rollout& rollout, const std::string& action, const std::string& group) {
  return rollout.suite().stream("actions/" + action + "/given/" + group).data.row<bool>(0)[0];
}

void start(Rollout& rollout, std::vector<int> worlds, std::vector<std::int64_t> episodes) {
  rollout.start(worlds, episodes);
}

TEST(Rollout, SuiteIsInThePublishedOrder) {
  Rollout rollout(blind());
  EXPECT_THAT(
      rollout.suite().names(),
      ElementsAre("qpos", "qvel", "robot_base_pose", "env_states", "task_info",
                  "actions/commanded_action", "actions/joint_pos", "actions/joint_pos_rel",
                  "actions/ee_twist", "actions/ee_pose", "obj_start", "grasp_state_pickup_obj",
                  "obj_end", "tcp_pose", "policy_phase", "policy_num_retries", "grasp_pose"));
  EXPECT_EQ(rollout.suite().owner("tcp_pose"), "robot 'franka'");
  EXPECT_EQ(rollout.suite().owner("grasp_pose"), "policy 'planner'");
}

TEST(Rollout, CamerasHaveVideosAndImagePoints) {
  RolloutCfg cfg = blind();
  cfg.cameras.reset();
  cfg.width = 16;
  cfg.height = 8;
  cfg.depth = true;
  Rollout rollout(cfg);
  std::vector<RecordedCamera> cameras = rollout.cameras();
  ASSERT_GE(cameras.size(), 2u);
  for (const RecordedCamera& camera : cameras) {
    EXPECT_EQ(rollout.suite().stream(camera.name).spec.storage, Storage::kRgbVideo);
    const SensorSpec& depth = rollout.suite().stream(camera.name + "_depth").spec;
    EXPECT_EQ(depth.storage, Storage::kDepthVideo);
    EXPECT_EQ(depth.shape, Shape({8, 16}));
  }
  cameras[0].image_points = false;
  const ActionLog log(1);
  const observe::SensorSuite suite = core_suite(rollout.task(), log, cameras);
  Sensor& points = suite.get("object_image_points");
  points.initialize({.model = rollout.task().model(), .num_worlds = 1});
  EXPECT_THAT(points.fields(), Not(IsEmpty()));
  for (const Field& field : points.fields()) {
    EXPECT_THAT(field.name, Not(HasSubstr(cameras[0].name)));
  }
}

// docs/observations.md shows these lines.
TEST(Rollout, FunctionSensor) {
  Rollout rollout(blind());
  start(rollout, {0}, {7});
  const robots::Robot& robot = rollout.task().robot();
  observe::SensorSuite suite;
  suite.add(std::make_shared<observe::FunctionSensor<float>>(
      "gripper_opening", SensorSpec{.unit = "m"},
      [&robot](const World& world, std::span<float> row) {
        row[0] = robot.opening(world, robot.gripper());
      }));
  EXPECT_THAT(suite.names(), ElementsAre("gripper_opening"));
}

TEST(Rollout, CommandsAreInTheUnitOfTheirActuators) {
  Rollout rollout(blind());
  const auto unit = [&](const std::string& stream) {
    return rollout.suite().stream("actions/" + stream).spec.unit;
  };
  for (const std::string name : {"commanded_action", "joint_pos"}) {
    EXPECT_EQ(unit(name + "/arm"), "rad");
    EXPECT_EQ(unit(name + "/gripper"), "0 open .. 255 closed");
    // The dataset that a recording writes has the same unit.
    EXPECT_EQ(record::text_of(rollout.suite().get("actions/" + name))->unit,
              "arm: rad; gripper: 0 open .. 255 closed");
  }
  EXPECT_EQ(unit("joint_pos_rel/arm"), "rad");
  // One command but two joints, so it has no relative position.
  EXPECT_EQ(unit("joint_pos_rel/gripper"), "");
  EXPECT_EQ(record::text_of(rollout.suite().get("actions/joint_pos_rel"))->unit, "arm: rad");
}

// Row t describes the action between observations t-1 and t.
TEST(Rollout, ActionsAreMeasuredFromTheObservationBefore) {
  Rollout rollout(blind());
  start(rollout, {0}, {7});
  for (const char* group : {"base", "arm", "gripper"}) {
    EXPECT_FALSE(given(rollout, "commanded_action", group)) << group;
    EXPECT_TRUE(given(rollout, "joint_pos_rel", group)) << group;
    EXPECT_TRUE(given(rollout, "ee_pose", group)) << group;
  }
  EXPECT_FALSE(given(rollout, "commanded_action", "success"));
  EXPECT_THAT(numbers(rollout, "actions/joint_pos_rel/arm"), ElementsAre(0, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(numbers(rollout, "actions/joint_pos_rel/gripper"), ElementsAre(0, 0));
  EXPECT_THAT(numbers(rollout, "actions/ee_twist/arm"), ElementsAre(0, 0, 0, 0, 0, 0));
  EXPECT_THAT(numbers(rollout, "actions/ee_pose/base"), ElementsAre(0, 0, 0, 1, 0, 0, 0));

  const robots::Robot& robot = rollout.task().robot();
  for (int t = 1; t <= 20; ++t) {
    const auto before = numbers<float>(rollout, "qpos/arm");
    const auto leaf_row = rollout.suite().stream("tcp_pose").data.row<float>(0);
    const Pose leaf{{leaf_row[0], leaf_row[1], leaf_row[2]},
                    {leaf_row[3], leaf_row[4], leaf_row[5], leaf_row[6]}};
    rollout.act();
    rollout.step();
    const auto target = numbers(rollout, "actions/joint_pos/arm");
    const auto relative = numbers(rollout, "actions/joint_pos_rel/arm");
    EXPECT_FALSE(given(rollout, "joint_pos_rel", "gripper"));  // one command but two joints
    EXPECT_TRUE(given(rollout, "joint_pos_rel", "arm"));
    for (int i = 0; i < 7; ++i) EXPECT_NEAR(relative[i], target[i] - before[i], 1e-6);
    // The twist must lead from the leaf frame to the target pose.
    const auto twist = numbers(rollout, "actions/ee_twist/arm");
    const Pose reached =
        leaf * exp6({{twist[0], twist[1], twist[2]}, {twist[3], twist[4], twist[5]}});
    robots::RobotValues values;
    values[robot.arm()].set(target);
    const Pose expected = robot.fk(robot.arm(), values);
    EXPECT_NEAR(norm(reached.p - expected.p), 0, 1e-5);
    EXPECT_NEAR(angle_between(reached.q, expected.q), 0, 1e-5);
    const auto pose = numbers(rollout, "actions/ee_pose/arm");
    EXPECT_NEAR(pose[0], expected.p.x, 1e-12);
    EXPECT_NEAR(pose[3], expected.q.w, 1e-12);
  }
}

TEST(Rollout, OnlyTheCommandIsGivenAtTheEnd) {
  Rollout rollout(blind());
  start(rollout, {0}, {7});
  int actions = 0;
  while (!rollout.evaluation(0).terminal && !rollout.evaluation(0).truncated) {
    rollout.act();
    rollout.step();
    ++actions;
  }
  EXPECT_TRUE(rollout.evaluation(0).terminal);
  EXPECT_TRUE(rollout.evaluation(0).success);
  EXPECT_GT(actions, 20);
  for (const char* name : {"joint_pos", "joint_pos_rel", "ee_twist", "ee_pose"}) {
    EXPECT_FALSE(given(rollout, name, "arm")) << name;
    for (double x : numbers(rollout, fmt::format("actions/{}/arm", name))) EXPECT_EQ(x, 0) << name;
  }
  EXPECT_TRUE(given(rollout, "commanded_action", "arm"));
  EXPECT_EQ(row(rollout, "task_info")["episode_step"], actions);
}

TEST(Rollout, TimeOutKeepsTheLastAction) {
  RolloutCfg cfg = blind();
  cfg.horizon = 3;
  Rollout rollout(cfg);
  start(rollout, {0}, {7});
  for (int t = 0; t < 3; ++t) {
    EXPECT_FALSE(rollout.evaluation(0).truncated);
    rollout.act();
    rollout.step();
  }
  EXPECT_TRUE(rollout.evaluation(0).truncated);
  EXPECT_FALSE(rollout.evaluation(0).terminal);
  for (const char* name : {"joint_pos", "joint_pos_rel", "ee_twist", "ee_pose"}) {
    EXPECT_TRUE(given(rollout, name, "arm")) << name;
  }
}

TEST(Rollout, PolicyVerdictIsNumeric) {
  RolloutCfg cfg = blind();
  cfg.policy.clear();
  Rollout rollout(cfg);
  start(rollout, {0}, {7});
  robots::Action& action = rollout.action(0);
  const double hold[7] = {0.1, -0.7, 0, -2.3, 0, 1.6, 0};
  action.commands[rollout.task().robot().arm()].set(hold);
  action.success = false;
  rollout.step();
  EXPECT_THAT(numbers<float>(rollout, "actions/commanded_action/arm"),
              ElementsAre(0.1f, -0.7f, 0, -2.3f, 0, 1.6f, 0));
  EXPECT_TRUE(given(rollout, "commanded_action", "arm"));
  EXPECT_FALSE(given(rollout, "commanded_action", "gripper"));
  EXPECT_TRUE(given(rollout, "commanded_action", "success"));
  EXPECT_THAT(numbers<float>(rollout, "actions/commanded_action/success"), ElementsAre(0));
  EXPECT_THAT(numbers(rollout, "actions/joint_pos/arm"),
              ElementsAre(0.1, -0.7, 0, -2.3, 0, 1.6, 0));
  EXPECT_TRUE(given(rollout, "joint_pos", "gripper"));  // its controller holds a position

  const auto& target = rollout.suite().stream("actions/joint_pos/gripper").spec;
  EXPECT_EQ(target.low, 0);
  EXPECT_EQ(target.high, 255);
  EXPECT_EQ(rollout.suite().stream("qpos/arm").spec.unit, "rad");
  EXPECT_EQ(rollout.suite().stream("qvel/arm").spec.unit, "rad/s");
  EXPECT_EQ(rollout.suite().stream("qpos/base").spec.shape, Shape({0}));
  EXPECT_EQ(rollout.suite().stream("actions/ee_pose/arm").spec.frame, "body robot_0/base");
}

// FNV-1a hash of all rows of a world.
std::uint64_t hash(Rollout& rollout, int world) {
  std::uint64_t h = 1469598103934665603ull;
  for (const Field* field : rollout.suite().streams()) {
    for (std::size_t i = 0; i < field->data.row_bytes(); ++i) {
      h = (h ^ static_cast<std::uint8_t>(field->data.row_data(world)[i])) * 1099511628211ull;
    }
  }
  return h;
}

// Hashes of the first observations of episodes 0 .. 4, played in worlds as they become free.
std::map<std::int64_t, std::vector<std::uint64_t>> play(RolloutCfg cfg) {
  cfg.more_sensors = [](Rollout&) {  // a sensor with noise
    return std::vector<std::shared_ptr<Sensor>>{std::make_shared<observe::FunctionSensor<double>>(
        "noise", SensorSpec{}, [](const World& world, std::span<double> row) {
          row[0] = world.rng(stream_of("noise")).uniform();
        })};
  };
  Rollout rollout(cfg);
  std::map<std::int64_t, std::vector<std::uint64_t>> seen;
  std::int64_t next = 0;
  const auto length = [](std::int64_t episode) {
    return 6 + 3 * static_cast<std::size_t>(episode);
  };
  while (true) {
    bool any = false;
    for (int w = 0; w < rollout.num_worlds(); ++w) {
      if (rollout.active(w) && seen[rollout.episode(w)].size() == length(rollout.episode(w))) {
        rollout.stop(w);
      }
      if (!rollout.active(w) && next < 5) {
        start(rollout, {w}, {next});
        seen[next++].push_back(hash(rollout, w));
      }
      any |= rollout.active(w);
    }
    if (!any) return seen;
    rollout.act();
    rollout.step();
    for (int w = 0; w < rollout.num_worlds(); ++w) {
      if (rollout.active(w)) seen[rollout.episode(w)].push_back(hash(rollout, w));
    }
  }
}

TEST(Rollout, EpisodesDoNotDependOnWorldOrThreads) {
  const auto alone = play(blind(1, 1));
  EXPECT_EQ(alone.size(), 5u);
  EXPECT_NE(alone.at(0)[3], alone.at(1)[3]);
  EXPECT_EQ(play(blind(3, 1)), alone);
  EXPECT_EQ(play(blind(4, 2)), alone);
  EXPECT_EQ(play(blind(5, 5)), alone);
}

TEST(Rollout, StepDoesNotAllocate) {
  Rollout rollout(blind(3, 2));
  start(rollout, {0, 1, 2}, {0, 1, 2});
  const auto run = [&](int steps) {
    for (int t = 0; t < steps; ++t) {
      rollout.act();
      rollout.step();
    }
  };
  run(5);
  const AllocationCount count;
  run(30);
  EXPECT_EQ(count.since(), 0);
}

// An object that is thrown away does not fly on until the horizon.
TEST(Rollout, ImpossibleSpeedsEndTheEpisode) {
  Rollout rollout(blind(2, 2));
  start(rollout, {0, 1}, {0, 1});
  const mjModel* m = rollout.simulation().model();
  int dof = 0;
  while (m->jnt_type[m->dof_jntid[dof]] != mjJNT_FREE) ++dof;
  robots::state_row(rollout.simulation().worlds(), 1).qvel[dof] = 1e7;
  rollout.act();
  rollout.step();
  EXPECT_THAT(rollout.fault(1), HasSubstr("the physics diverged: body '"));
  EXPECT_EQ(rollout.fault(0), "");
  start(rollout, {1}, {1});
  EXPECT_EQ(rollout.fault(1), "");
}

TEST(Rollout, DivergingWorldDoesNotAffectOthers) {
  const auto run = [](bool poison) {
    Rollout rollout(blind(2, 2));
    start(rollout, {0, 1}, {0, 1});
    for (int t = 0; t < 8; ++t) {
      if (poison && t == 4) {
        const robots::StateRow state = robots::state_row(rollout.simulation().worlds(), 1);
        state.qvel[0] = std::numeric_limits<double>::quiet_NaN();
      }
      rollout.act();
      rollout.step();
    }
    if (poison) {
      EXPECT_THAT(rollout.fault(1), HasSubstr("MuJoCo"));
      start(rollout, {1}, {1});  // and it can start again
      EXPECT_EQ(rollout.fault(1), "");
      rollout.act();
      rollout.step();
      EXPECT_EQ(row(rollout, "task_info", 1)["episode_step"], 1);
    } else {
      rollout.act();
      rollout.step();
    }
    EXPECT_EQ(rollout.fault(0), "");
    return hash(rollout, 0);
  };
  EXPECT_EQ(run(true), run(false));
}

TEST(Rollout, RowThatDoesNotFitEndsOnlyItsEpisode) {
  Rollout rollout(blind(2));
  rollout.suite().add(std::make_shared<observe::JsonFunctionSensor>(
      "notes", 16, "", [&](const World& world, JsonWriter& json) {
        const int step = rollout.task().episode_step(world.id);
        json.begin_object();
        json.key("n").value(world.id == 1 && step == 3 ? "much longer than that" : "short");
        json.end_object();
      }));
  rollout.suite().bind(rollout.simulation());
  start(rollout, {0, 1}, {0, 1});
  for (int t = 0; t < 5; ++t) {
    rollout.act();
    rollout.step();
    EXPECT_EQ(rollout.fault(1).empty(), t < 2) << t;
  }
  EXPECT_EQ(rollout.fault(1),
            "sensor 'notes', world 1: its text needs 29 bytes, str_max_len is 16");
  EXPECT_TRUE(rollout.refused(1));
  EXPECT_EQ(rollout.fault(0), "");
  EXPECT_FALSE(rollout.refused(0));
  EXPECT_EQ(row(rollout, "task_info", 0)["episode_step"], 5);
}

// Computes the rows of all worlds in one call, and fails for two of them at one step.
struct Batch final : Sensor {
  explicit Batch(const episode::Task& task) : Sensor("batch"), task(task) {}
  std::string_view kind() const override { return "batch"; }
  Stage stage() const override { return Stage::kBatch; }
  void initialize(const SensorInit& init) override {
    add_field("", {.dtype = DType::kInt64}, init.num_worlds);
    computed.assign(init.num_worlds, 0);
  }
  void compute(const World& /*world*/) override {}
  void cast(const CastContext& context) override {
    std::vector<RowError::Fault> faults;
    for (int w : context.ids) {
      ++computed[w];
      if (w != 1 && task.episode_step(w) == 2)
        faults.push_back({w, fmt::format("sensor 'batch', world {}: no row", w)});
    }
    if (!faults.empty()) throw RowError(faults);
  }
  const episode::Task& task;
  std::vector<int> computed;
};

TEST(Rollout, FailingRowsEndOnlyTheirEpisodes) {
  RolloutCfg cfg = blind(3);
  std::shared_ptr<Batch> batch;
  cfg.more_sensors = [&](Rollout& rollout) {
    batch = std::make_shared<Batch>(rollout.task());
    return std::vector<std::shared_ptr<Sensor>>{batch};
  };
  Rollout rollout(cfg);
  start(rollout, {0, 1, 2}, {0, 1, 2});
  for (int t = 0; t < 4; ++t) {
    rollout.act();
    rollout.step();
  }
  for (int w : {0, 2}) {
    EXPECT_EQ(rollout.fault(w), fmt::format("sensor 'batch', world {}: no row", w));
    EXPECT_TRUE(rollout.refused(w));
  }
  EXPECT_EQ(rollout.fault(1), "");
  EXPECT_THAT(batch->computed, ElementsAre(3, 5, 3));  // no row was computed twice
}

TEST(Rollout, WrongNamesAndNumbersThrow) {
  const auto error = [](auto change) -> std::string {
    RolloutCfg cfg = blind();
    change(cfg);
    return error_of([&] { Rollout rollout(cfg); });
  };
  EXPECT_EQ(error([](RolloutCfg& c) { c.num_worlds = -2; }), "worlds is -2: must be at least 1");
  EXPECT_EQ(error([](RolloutCfg& c) { c.cameras = {{"wrist_camra"}}; }),
            "robot 'franka': no camera named 'wrist_camra'; did you mean 'wrist_camera'?");
  EXPECT_THAT(error([](RolloutCfg& c) {
                c.cameras = {{"wrist_camera", "wrist_camera"}};
              }),
              HasSubstr("given twice"));
  EXPECT_THAT(error([](RolloutCfg& c) { c.robot = "frank"; }), HasSubstr("did you mean 'franka'?"));
  EXPECT_THAT(error([](RolloutCfg& c) { c.task = "pik"; }), HasSubstr("did you mean 'pick'?"));
  EXPECT_THAT(error([](RolloutCfg& c) { c.policy = "planer"; }),
              HasSubstr("did you mean 'planner'?"));
  EXPECT_THAT(error([](RolloutCfg& c) { c.horizon = 0; }), HasSubstr("horizon"));
}

}  // namespace
}  // namespace mjsense::tasks::rollout
