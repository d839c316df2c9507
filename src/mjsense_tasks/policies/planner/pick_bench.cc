// SPDX-License-Identifier: Apache-2.0
// Benchmark of the pick task without sensors: time of planning and physics, and success rate.
//   mjsense_bench --benchmark_filter=Pick

#include <benchmark/benchmark.h>

#include <memory>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense_tasks/policies/planner/pick_loop.h"
#include "mjsense_tasks/policies/planner/pick_planner.h"
#include "mjsense_tasks/robots/load_robot.h"
#include "mjsense_tasks/tasks/pick/pick.h"

namespace mjsense::tasks::policies {
namespace {

struct Stage {
  explicit Stage(bool noise) {
    episode::TaskCfg cfg;
    cfg.robot = robots::robot_cfg("franka");
    cfg.scene = "table";
    cfg.action_noise = noise;
    task = std::make_unique<tasks::PickTask>(cfg);
    scene = std::make_unique<scene::Scene>(task->scene_cfg_with_robot());
    task->initialize(scene->model(), 1);
    policy = std::make_unique<PickPlanner>();
    task->register_policy(*policy);
    data.reset(mj_makeData(scene->model()));
  }
  std::unique_ptr<episode::Task> task;
  std::unique_ptr<scene::Scene> scene;
  std::unique_ptr<episode::Policy> policy;
  DataPtr data;
};

// One episode per iteration: episodes 0, 1, 2 ... of seed 0.
void pick_episode(benchmark::State& state) {
  Stage stage(state.range(0) != 0);
  std::int64_t episode = 0, steps = 0, successes = 0;
  for (auto _ : state) {
    const EpisodeResult result =
        run_episode(*stage.task, *stage.policy, stage.data.get(), 0, episode++);
    steps += result.steps;
    successes += result.success;
  }
  state.counters["success"] = static_cast<double>(successes) / static_cast<double>(episode);
  state.counters["steps/s"] =
      benchmark::Counter(static_cast<double>(steps), benchmark::Counter::kIsRate);
}
BENCHMARK(pick_episode)
    ->Name("PickEpisode/noise")
    ->Arg(0)
    ->Arg(1)
    ->Iterations(100)
    ->Unit(benchmark::kMillisecond);

// Samples and plans an episode: the cost of a reset.
void pick_plan(benchmark::State& state) {
  Stage stage(false);
  mjData* data = stage.data.get();
  World world{.id = 0, .model = stage.scene->model(), .data = data};
  std::int64_t episode = 0;
  for (auto _ : state) {
    stage.task->sample(0, episode++, robots::state_row(data));
    mj_forward(world.model, data);
    stage.task->begin(world);
    stage.policy->reset(world);
  }
}
BENCHMARK(pick_plan)->Name("PickPlan")->Iterations(100)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mjsense::tasks::policies
