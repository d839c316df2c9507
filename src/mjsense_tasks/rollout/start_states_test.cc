// SPDX-License-Identifier: Apache-2.0
// Samples starts of many episodes and plays none of them: no object may start inside another, and the
// robot reaches the target.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "mjsense_tasks/rollout/rollout.h"
#include "mjsense_tasks/scenes/load_scene.h"

namespace mjsense::tasks::rollout {
namespace {

using ::testing::StartsWith;

constexpr int kWorlds = 8;

RolloutCfg blind(std::string_view task, std::string_view robot, std::string_view scene,
                 std::string_view policy) {
  RolloutCfg cfg;
  cfg.task = task;
  cfg.robot = robot;
  cfg.scene = scene;
  cfg.policy = policy;
  cfg.num_worlds = kWorlds;
  cfg.cameras.emplace();
  return cfg;
}

// Calls `visit(world)` for each of the first `episodes` starts.
void start_all(Rollout& rollout, int episodes, const std::function<void(int world)>& visit) {
  std::vector<int> worlds(kWorlds);
  std::iota(worlds.begin(), worlds.end(), 0);
  std::vector<std::int64_t> numbers(kWorlds);
  for (int first = 0; first < episodes; first += kWorlds) {
    std::iota(numbers.begin(), numbers.end(), first);
    rollout.start(worlds, numbers);
    for (int w : worlds) visit(w);
  }
}

std::vector<double> states(Rollout& rollout) {
  const ArrayView rows = rollout.simulation().worlds().state();
  const auto* begin = reinterpret_cast<const double*>(rows.data);
  return {begin, begin + rows.shape[0] * rows.shape[1]};
}

// Two large plates next to the object to be moved fit only if all three are drawn again together.
TEST(Starts, ObjectsDoNotOverlap) {
  Rollout rollout(blind("pick_and_place_color", kTaskRobot, "", ""));
  start_all(rollout, 112, [&](int w) { EXPECT_EQ(rollout.fault(w), "") << rollout.episode(w); });
}

// Without further draws, this short arm has no plan at 12 of these 32 starts.
TEST(Starts, RobotReachesTheTarget) {
  Rollout rollout(blind("pick", "i2rt_yam", "shelf", "planner"));
  int unplanned = 0;
  start_all(rollout, 32,
            [&](int w) { unplanned += rollout.policy()->failure(w).starts_with("found no plan"); });
  EXPECT_LE(unplanned, 2);
}

TEST(Starts, DoNotDependOnThePolicy) {
  Rollout planned(blind("pick", "i2rt_yam", "shelf", "planner"));
  Rollout other(blind("pick", "i2rt_yam", "shelf", ""));
  start_all(planned, kWorlds, [](int) {});
  start_all(other, kWorlds, [](int) {});
  EXPECT_EQ(states(planned), states(other));
}

TEST(Starts, TargetOutOfReachIsAcceptedIfThereIsNoOther) {
  RolloutCfg cfg = blind("pick", "franka", "", "planner");
  cfg.make_scene = [] {
    scenes::SceneFileCfg scene = scenes::load_scene("table");
    scene.robot.pos[0] -= 2;
    return scene;
  };
  Rollout rollout(cfg);
  start_all(rollout, kWorlds, [&](int w) {
    EXPECT_EQ(rollout.fault(w), "");
    EXPECT_THAT(rollout.policy()->failure(w), StartsWith("found no plan"));
  });
}

}  // namespace
}  // namespace mjsense::tasks::rollout
