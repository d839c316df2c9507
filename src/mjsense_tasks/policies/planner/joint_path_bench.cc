// SPDX-License-Identifier: Apache-2.0
// Benchmark of path planning for a Franka in clutter, for problems whose straight line is blocked:
// planning time, number of collision checks, path length and motion time.
//   mjsense_bench --benchmark_filter=Ways

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/scene.h"
#include "mjsense_tasks/policies/planner/hand_planner.h"
#include "mjsense_tasks/robots/load_robot.h"
#include "mjsense_tasks/rollout/registry.h"
#include "mjsense_tasks/rollout/task_defaults.h"

namespace mjsense::tasks::policies {
namespace {

using Config = std::span<const double>;
constexpr int kProblems = 100;

// Two free configurations with a blocked straight line.
struct Problem {
  std::vector<double> start, goal;
};

struct Clutter {
  std::unique_ptr<episode::Task> task;
  std::unique_ptr<scene::Scene> scene;
  DataPtr data;
  std::unique_ptr<HandPlanner> hand;
  std::vector<Problem> problems;
  JointSpace joints;

  Clutter() {
    episode::TaskCfg cfg;
    cfg.robot = robots::robot_cfg("franka");
    cfg.scene = "clutter";
    rollout::set_task_defaults("pick", cfg);
    task = rollout::make_task("pick", cfg);
    scene = std::make_unique<scene::Scene>(task->scene_cfg_with_robot());
    task->initialize(scene->model(), 1);
    data.reset(mj_makeData(scene->model()));
    task->sample(0, 0, robots::state_row(data.get()));
    mj_forward(scene->model(), data.get());
    const robots::Robot& robot = task->robot();
    hand = std::make_unique<HandPlanner>(scene->model(), robot,
                                         robots::hands_of(robot, scene->model())[0]);
    for (const int j : robot.groups()[hand->hand().tool].joints) {
      joints.low.push_back(scene->model()->jnt_range[2 * j]);
      joints.high.push_back(scene->model()->jnt_range[2 * j + 1]);
    }
    joints.speed.assign(joints.low.size(), 1.5);
    joints.acceleration.assign(joints.low.size(), 4);
    CollisionQuery query = ask();
    Rng rng(0, 0, 0, 0);
    const auto free_place = [&] {
      std::vector<double> q(joints.size());
      do {
        for (std::size_t i = 0; i < q.size(); ++i)
          q[i] = rng.uniform(joints.low[i], joints.high[i]);
      } while (!query.free(q));
      return q;
    };
    while (problems.size() < kProblems) {
      Problem problem{free_place(), free_place()};
      if (!query.free_between(problem.start, problem.goal)) problems.push_back(std::move(problem));
    }
  }
  CollisionQuery ask() { return {hand->collisions(), World{0, scene->model(), data.get()}}; }
};

// Cost and quality of one path.
struct Found {
  bool solved = false;
  double ms = 0;
  double length = 0, seconds = 0;  // path length, rad; motion time
  long asked = 0;                  // collision checks, of configurations and lines
};

double length_of(std::span<const double> path, std::size_t n) {
  double sum = 0;
  for (std::size_t i = n; i < path.size(); i += n) {
    double squares = 0;
    for (std::size_t k = 0; k < n; ++k)
      squares += (path[i + k] - path[i + k - n]) * (path[i + k] - path[i + k - n]);
    sum += std::sqrt(squares);
  }
  return sum;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::nth_element(values, values.begin() + values.size() / 2);
  return values[values.size() / 2];
}

// One iteration plans all problems.
void paths(benchmark::State& state) {
  static Clutter clutter;
  std::vector<Found> all;
  for (auto _ : state) {
    for (int k = 0; k < kProblems; ++k) {
      const Problem& problem = clutter.problems[k];
      CollisionQuery query = clutter.ask();
      Found found;
      const FreeSpace free{
          [&](Config q) { return ++found.asked, query.free(q); },
          [&](Config a, Config b) { return ++found.asked, query.free_between(a, b); }};
      Rng rng(k, 0, 0, 0);
      const auto begin = std::chrono::steady_clock::now();
      const std::vector<double> path =
          find_path(clutter.joints, problem.start, problem.goal, free, rng);
      found.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
                     .count();
      found.solved = !path.empty();
      found.length = length_of(path, clutter.joints.size());
      if (found.solved) found.seconds = time_path(clutter.joints, 0, path, free).times.back();
      all.push_back(found);
    }
  }
  std::vector<double> ms, asked, length, seconds;
  for (const Found& one : all) {
    ms.push_back(one.ms);
    asked.push_back(static_cast<double>(one.asked));
    if (!one.solved) continue;
    length.push_back(one.length);
    seconds.push_back(one.seconds);
  }
  state.counters["solved_%"] =
      100.0 * static_cast<double>(length.size()) / static_cast<double>(all.size());
  state.counters["median_ms"] = median(ms);
  state.counters["median_asked"] = median(asked);
  state.counters["median_rad"] = median(length);
  state.counters["median_s"] = median(seconds);
}

BENCHMARK(paths)->Name("Ways")->Iterations(3)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mjsense::tasks::policies
