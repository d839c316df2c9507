// SPDX-License-Identifier: Apache-2.0
#include "mjsense/policies/planner/manipulation_planner.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "mjsense/core/parallel.h"
#include "mjsense/policies/planner/pick_loop.h"
#include "mjsense/robots/load_robot.h"
#include "mjsense/rollout/registry.h"

namespace mjsense {
namespace {

using DataPtr = std::unique_ptr<mjData, decltype(&mj_deleteData)>;

// A task with its planner in worlds of plain MuJoCo.
struct Play {
  Play(const std::string& task_name, const std::string& robot, const std::string& scene_name,
       int num_worlds, bool noise = false) {
    TaskCfg cfg;
    cfg.robot = robot_cfg(robot);
    cfg.scene = scene_name;
    cfg.policy_dt_ms = cfg.robot.policy_dt_ms;
    cfg.ctrl_dt_ms = cfg.robot.ctrl_dt_ms;
    cfg.sim_dt_ms = cfg.robot.sim_dt_ms;
    cfg.action_noise = noise;
    task = make_task(task_name, cfg);
    scene = std::make_unique<Scene>(task->whole_scene_cfg());
    task->initialize(scene->model(), num_worlds);
    planner = std::make_unique<ManipulationPlanner>();
    task->register_policy(*planner);
    for (int w = 0; w < num_worlds; ++w)
      data.emplace_back(mj_makeData(scene->model()), mj_deleteData);
  }
  EpisodeResult run(int world, std::int64_t episode) {
    return run_episode(*task, *planner, data[world].get(), world, episode);
  }
  std::unique_ptr<Task> task;
  std::unique_ptr<Scene> scene;
  std::unique_ptr<ManipulationPlanner> planner;
  std::vector<DataPtr> data;
};

std::string setting(const char* name, const char* otherwise) {
  const char* value = std::getenv(name);
  return value ? value : otherwise;
}

// Of a grasp's approach, from above.
double tilt(const Pose& grasp) {
  return std::acos(std::clamp(-rotate(grasp.q, {0, 0, 1}).z, -1.0, 1.0)) * 180 / M_PI;
}

// MJSENSE_PLAY="pick franka clutter" MJSENSE_EPISODES=50 policies_test --gtest_filter=*PicksFrom*
TEST(ManipulationPlanner, PicksFromManyDirections) {
  const int episodes = std::atoi(setting("MJSENSE_EPISODES", "8").c_str());
  char task[64] = "pick", robot[64] = "franka", scene[256] = "";
  std::sscanf(setting("MJSENSE_PLAY", "pick franka").c_str(), "%63s %63s %255s", task, robot,
              scene);
  const bool shown = std::getenv("MJSENSE_EPISODES") != nullptr;
  Play play(task, robot, scene, 2, std::getenv("MJSENSE_NOISE") != nullptr);
  std::vector<EpisodeResult> results(episodes);
  std::vector<double> tilts(episodes);
  std::vector<std::string> text(episodes);
  ThreadPool pool(2);
  pool.run(episodes, [&](int e, int w) {
    results[e] = play.run(w, e);
    tilts[e] = tilt(play.planner->grasp_pose(w));
    text[e] = play.task->description(w) + ", retries " +
              std::to_string(play.planner->num_retries(w)) + ", last " +
              std::string(word(play.planner->last_failure(w))) + ", phase " +
              std::to_string(play.planner->phase(w));
  });
  int successes = 0, slanting = 0;
  for (int e = 0; e < episodes; ++e) {
    const EpisodeResult& r = results[e];
    successes += r.success;
    slanting += r.success && tilts[e] > 30.5;
    if (shown)
      printf("%3d %s %3d steps, gave up %d, truncated %d, tilt %2.0f, first plan %.0f ms: %s\n", e,
             r.success ? "ok  " : "FAIL", r.steps, r.gave_up, r.truncated, tilts[e],
             1000 * r.first_plan_s, text[e].c_str());
  }
  if (shown) printf("%d of %d, %d from more than 30 degrees\n", successes, episodes, slanting);
  EXPECT_GE(successes, 0.85 * episodes);
  EXPECT_GE(slanting, episodes / 3);
}

}  // namespace
}  // namespace mjsense
