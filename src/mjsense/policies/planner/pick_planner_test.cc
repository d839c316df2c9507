#include "mjsense/policies/planner/pick_planner.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <vector>

#include "mjsense/core/parallel.h"
#include "mjsense/policies/planner/pick_loop.h"

namespace mjsense {
namespace {

struct DataDelete {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using DataPtr = std::unique_ptr<mjData, DataDelete>;

struct Stage {
  explicit Stage(int num_worlds, bool noise = false) {
    TaskCfg cfg;
    cfg.robot = robot_cfg("franka");
    cfg.action_noise = noise;
    task = make_task("pick", cfg);
    scene = std::make_unique<Scene>(task->scene_cfg());
    task->initialize(scene->model(), num_worlds);
    policy = make_policy("planner");
    task->register_policy(*policy);
    for (int w = 0; w < num_worlds; ++w) data.emplace_back(mj_makeData(scene->model()));
  }
  std::unique_ptr<Task> task;
  std::unique_ptr<Scene> scene;
  std::unique_ptr<Policy> policy;
  std::vector<DataPtr> data;
};

TEST(PickPlanner, PicksUpMostObjects) {
  const char* wanted = std::getenv("MJSENSE_PICK_EPISODES");
  const int episodes = wanted ? std::atoi(wanted) : 10;
  const bool noise = std::getenv("MJSENSE_PICK_NOISE") != nullptr;
  Stage stage(2, noise);
  std::vector<EpisodeResult> results(episodes);
  std::vector<std::string> text(episodes);
  ThreadPool pool(2);
  pool.run(episodes, [&](int e, int w) {
    results[e] = run_episode(*stage.task, *stage.policy, stage.data[w].get(), w, e);
    text[e] = stage.task->description(w) + " retries " +
              std::to_string(static_cast<PlannerPolicy&>(*stage.policy).num_retries(w));
  });
  int successes = 0;
  for (int e = 0; e < episodes; ++e) {
    const EpisodeResult& r = results[e];
    successes += r.success;
    if (wanted)
      printf("%3d %-32s steps %3d success %d gave_up %d truncated %d reward %.4f\n", e, text[e].c_str(), r.steps,
             r.success, r.gave_up, r.truncated, r.reward);
  }
  RecordProperty("successes", successes);
  if (wanted) printf("%d of %d\n", successes, episodes);
  EXPECT_GE(successes, 0.9 * episodes);
}

}  // namespace
}  // namespace mjsense
