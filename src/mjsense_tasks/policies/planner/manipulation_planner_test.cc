// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/manipulation_planner.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <set>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense_tasks/episode/testing/played_task.h"
#include "mjsense_tasks/policies/planner/opening_planner.h"
#include "mjsense_tasks/policies/planner/pick_loop.h"
#include "mjsense_tasks/policies/planner/testing/motion_quality.h"
#include "mjsense_tasks/rollout/registry.h"
#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense::tasks::policies {
namespace {

// A task with its planner, in worlds of plain MuJoCo.
struct Play {
  Play(const std::string& task_name, const std::string& robot, const std::string& scene_name,
       int num_worlds, bool noise = false, double perturb = 0) {
    episode::TaskCfg cfg = episode::task_cfg(robot, scene_name);
    cfg.action_noise = noise;
    cfg.perturb = perturb;
    task = rollout::make_task(task_name, cfg);
    scene = std::make_unique<scene::Scene>(task->scene_cfg_with_robot());
    task->initialize(scene->model(), num_worlds);
    if (task_name == "open")
      planner = std::make_unique<OpeningPlanner>();
    else
      planner = std::make_unique<ManipulationPlanner>();
    task->register_policy(*planner);
    for (int w = 0; w < num_worlds; ++w) data.push_back(make_data(scene->model()));
  }
  EpisodeResult run(int world, std::int64_t episode,
                    const std::function<void(const World&)>& each_step = {}) {
    return run_episode(*task, *planner, data[world].get(), world, episode, each_step);
  }
  std::unique_ptr<episode::Task> task;
  std::unique_ptr<scene::Scene> scene;
  std::unique_ptr<TaskPlanner> planner;
  std::vector<DataPtr> data;
};

std::string setting(const char* name, const char* otherwise) {
  const char* value = std::getenv(name);
  return value ? value : otherwise;
}

// Tilt of a grasp's approach from vertical, degrees.
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
  Play play(task, robot, scene, 2, std::getenv("MJSENSE_NOISE") != nullptr,
            std::atof(setting("MJSENSE_PERTURB", "0").c_str()));
  std::vector<EpisodeResult> results(episodes);
  std::vector<double> tilts(episodes);
  std::vector<char> happened(episodes);
  std::vector<int> retries(episodes);
  std::vector<std::string> text(episodes);
  ThreadPool pool(2);
  pool.run(episodes, [&](int e, int w) {
    results[e] = play.run(w, e);
    tilts[e] = tilt(play.planner->grasp_pose(w));
    happened[e] = play.task->perturbation(w).happened();
    retries[e] = play.planner->num_retries(w);
    text[e] = play.task->description(w) + ", retries " +
              std::to_string(play.planner->num_retries(w)) + ", last " +
              std::string(enum_name(play.planner->last_failure(w))) + ", phase " +
              std::to_string(play.planner->phase(w));
  });
  int successes = 0, slanting = 0, mishaps = 0, retried = 0, mended = 0;
  for (int e = 0; e < episodes; ++e) {
    const EpisodeResult& r = results[e];
    successes += r.success;
    mishaps += happened[e];
    retried += retries[e] > 0;
    mended += retries[e] > 0 && r.success;
    slanting += r.success && tilts[e] > 30.5;
    if (shown)
      printf("%3d %s %3d steps, gave up %d, truncated %d, tilt %2.0f, first plan %.0f ms: %s\n", e,
             r.success ? "ok  " : "FAIL", r.steps, r.gave_up, r.truncated, tilts[e],
             1000 * r.first_plan_s, text[e].c_str());
  }
  if (shown)
    printf(
        "%d of %d, %d from more than 30 degrees; %d mishaps, %d with retries, %d of them mended\n",
        successes, episodes, slanting, mishaps, retried, mended);
  EXPECT_GE(successes, 0.85 * episodes);
  EXPECT_GE(slanting, episodes / 3);
}

// The robot touches only the target; joint speeds stay below the 2.62 rad/s of an FR3.
TEST(ManipulationPlanner, MotionsAreSmoothAndFreeOfCollisions) {
  Play play("pick_and_place", "franka", "", 1);
  for (int episode = 0; episode < 3; ++episode) {
    MotionQuality quality(play.scene->model(), play.task->robot());
    play.run(0, episode, [&](const World& world) { quality.look(world); });
    EXPECT_LT(quality.speed, 2.0) << episode;
    EXPECT_LT(quality.acceleration, 30) << episode << ": " << quality.accelerated;
    EXPECT_LT(quality.depth, 0.001) << quality.deepest << ", episode " << episode;
    EXPECT_EQ(quality.self_collisions, 0) << episode;
  }
}

TEST(ManipulationPlanner, AnEpisodeIsTheSameInEveryWorld) {
  Play play("pick_and_place", "franka", "", 3, /*noise=*/true, /*perturb=*/1.0);
  play.run(0, 3);
  play.run(2, 5);  // must not affect the next episode
  play.run(2, 3);
  EXPECT_EQ(0, std::memcmp(play.data[0]->qpos, play.data[2]->qpos,
                           play.scene->model()->nq * sizeof(double)));
}

// The result is identical bit for bit for one and two threads, with other episodes in parallel.
TEST(ManipulationPlanner, AnEpisodeDoesNotDependOnOtherWorldsOrThreads) {
  const auto play = [](int worlds, int threads) {
    rollout::RolloutCfg cfg;
    cfg.task = "pick_and_place";
    cfg.num_worlds = worlds;
    cfg.threads = threads;
    cfg.cameras.emplace();
    cfg.perturb = 1;
    rollout::Rollout rollout(cfg);
    std::vector<int> ids(worlds);
    std::vector<std::int64_t> episodes(worlds);
    for (int w = 0; w < worlds; ++w) {
      ids[w] = w;
      episodes[w] = 7 - w;
    }
    rollout.start(ids, episodes);
    for (int step = 0; step < 90; ++step) {
      rollout.act();
      rollout.step();
    }
    const robots::StateRow row = robots::state_row(rollout.simulation().worlds(), worlds - 1);
    return std::vector<double>(row.qpos, row.qpos + rollout.simulation().scene().model()->nq);
  };
  // The last of five worlds has episode 3.
  const auto many = play(5, 2);
  EXPECT_EQ(many, play(5, 1));
}

// +y is left. In these episodes the object is well off the middle.
TEST(ManipulationPlanner, TheNearerOfTwoArmsPicks) {
  Play play("pick", "bimanual_yam", "", 1);
  std::set<std::string> used;
  for (int episode : {5, 12, 14, 16}) {
    std::string hand;
    const EpisodeResult result = play.run(0, episode, [&](const World&) {
      const robots::Action* action = play.task->last_action(0);
      for (std::size_t g = 0; action && g < play.task->robot().groups().size(); ++g) {
        const robots::MoveGroup& group = play.task->robot().groups()[g];
        const robots::GroupValues& command = action->commands[g];
        if (group.kind == robots::GroupKind::kGripper && command.given &&
            command.values[0] == group.closed_command)
          hand = group.name;
      }
    });
    EXPECT_TRUE(result.success) << episode;
    const double y = play.planner->grasp_pose(0).p.y;
    EXPECT_GT(std::abs(y), 0.1) << episode;
    EXPECT_EQ(hand, y > 0 ? "left_gripper" : "right_gripper") << episode;
    used.insert(hand);
  }
  EXPECT_EQ(used.size(), 2u);
}

// Perturbed episodes: the object is pushed or slips but is picked up by a retry, and furniture is
// opened. The episode number determines which episodes are perturbed.
TEST(ManipulationPlanner, RetriesSucceedAfterPerturbations) {
  for (const auto& [task, scene] : {std::pair{"pick", "tableware"}, {"open", "kitchen"}}) {
    Play play(task, "franka", scene, 1, /*noise=*/false, /*perturb=*/1.0);
    int happened = 0, retried = 0, mended = 0;
    for (int episode = 0; episode < 8; ++episode) {
      const EpisodeResult result = play.run(0, episode);
      happened += play.task->perturbation(0).happened();
      retried += play.planner->num_retries(0) > 0;
      mended += play.planner->num_retries(0) > 0 && result.success;
    }
    EXPECT_GE(happened, 6) << task;
    EXPECT_GE(retried, 3) << task;
    EXPECT_GE(mended, retried - 1) << task;
  }
}

}  // namespace
}  // namespace mjsense::tasks::policies
