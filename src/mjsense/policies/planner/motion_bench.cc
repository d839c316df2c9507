// SPDX-License-Identifier: Apache-2.0
// Ways of a Franka among clutter that are not straight: ours, and OMPL's RRT-Connect (libompl-dev, where it is
// installed) with the same questions about collisions, the same longest edge, and samples from the same generator.
//   mjsense_bench --benchmark_filter=Ways

#include <benchmark/benchmark.h>

#ifdef MJSENSE_BENCH_OMPL
#include <ompl/base/ScopedState.h>
#include <ompl/base/goals/GoalState.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/datastructures/NearestNeighborsLinear.h>
#include <ompl/geometric/PathSimplifier.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>
#endif

#include <algorithm>
#include <chrono>
#include <cmath>

#include "mjsense/policies/planner/hand_planner.h"
#include "mjsense/robots/load_robot.h"
#include "mjsense/rollout/registry.h"
#include "mjsense/rollout/task_defaults.h"
#include "mjsense/scene/scene.h"

namespace mjsense {
namespace {

using Config = std::span<const double>;
constexpr int kProblems = 100;

// Two places of the arm, and something between them.
struct Problem {
  std::vector<double> start, goal;
};

struct Clutter {
  std::unique_ptr<Task> task;
  std::unique_ptr<Scene> scene;
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data{nullptr, mj_deleteData};
  std::unique_ptr<HandPlanner> hand;
  std::vector<Problem> problems;
  JointSpace joints;

  Clutter() {
    TaskCfg cfg;
    cfg.robot = robot_cfg("franka");
    cfg.scene = "clutter";
    set_task_defaults("pick", cfg);
    task = make_task("pick", cfg);
    scene = std::make_unique<Scene>(task->whole_scene_cfg());
    task->initialize(scene->model(), 1);
    data.reset(mj_makeData(scene->model()));
    task->sample(0, 0, state_row(data.get()));
    mj_forward(scene->model(), data.get());
    const Robot& robot = task->robot();
    hand = std::make_unique<HandPlanner>(scene->model(), robot, hands_of(robot, scene->model())[0]);
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

// What a way has cost, and how good it is.
struct Found {
  bool solved = false;
  double ms = 0, length = 0;  // length in rad
  long asked = 0;             // configurations and pieces between two
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

using Finder = std::vector<double> (*)(const JointSpace&, const Problem&, const FreeSpace&, Rng&);

std::vector<double> ours(const JointSpace& joints, const Problem& p, const FreeSpace& free,
                         Rng& rng) {
  return find_path(joints, p.start, p.goal, free, rng);
}

#ifdef MJSENSE_BENCH_OMPL
namespace ob = ompl::base;
namespace og = ompl::geometric;

Config view(const ob::State* state, std::size_t n) {
  return {state->as<ob::RealVectorStateSpace::StateType>()->values, n};
}

struct Samples : ob::StateSampler {
  Samples(const ob::StateSpace* space, const JointSpace& joints, Rng& rng)
      : StateSampler(space), joints(joints), rng(rng) {}
  void sampleUniform(ob::State* state) override {
    double* q = state->as<ob::RealVectorStateSpace::StateType>()->values;
    for (std::size_t i = 0; i < joints.size(); ++i)
      q[i] = rng.uniform(joints.low[i], joints.high[i]);
  }
  void sampleUniformNear(ob::State* state, const ob::State*, double) override {
    sampleUniform(state);
  }
  void sampleGaussian(ob::State* state, const ob::State*, double) override { sampleUniform(state); }
  const JointSpace& joints;
  Rng& rng;
};

struct Motions : ob::MotionValidator {
  Motions(const ob::SpaceInformationPtr& si, const FreeSpace& free, std::size_t n)
      : MotionValidator(si), free(free), n(n) {}
  // As OMPL's own: the beginning is known to be free.
  bool checkMotion(const ob::State* a, const ob::State* b) const override {
    return free.at(view(b, n)) && free.between(view(a, n), view(b, n));
  }
  bool checkMotion(const ob::State* a, const ob::State* b,
                   std::pair<ob::State*, double>&) const override {
    return checkMotion(a, b);
  }
  const FreeSpace& free;
  std::size_t n;
};

struct Shortcuts : og::PathSimplifier {
  Shortcuts(const ob::SpaceInformationPtr& si, Rng& rng) : PathSimplifier(si) {
    rng_.setLocalSeed(rng.below(1u << 30));
  }
};

std::vector<double> ompls(const JointSpace& joints, const Problem& p, const FreeSpace& free,
                          Rng& rng) {
  const std::size_t n = joints.size();
  const MotionCfg cfg;
  auto space = std::make_shared<ob::RealVectorStateSpace>(n);
  ob::RealVectorBounds bounds(n);
  bounds.low = joints.low;
  bounds.high = joints.high;
  space->setBounds(bounds);
  space->setStateSamplerAllocator([&](const ob::StateSpace* s) -> ob::StateSamplerPtr {
    return std::make_shared<Samples>(s, joints, rng);
  });
  auto si = std::make_shared<ob::SpaceInformation>(space);
  si->setStateValidityChecker([&](const ob::State* s) { return free.at(view(s, n)); });
  si->setMotionValidator(std::make_shared<Motions>(si, free, n));
  si->setup();
  auto task = std::make_shared<ob::ProblemDefinition>(si);
  ob::ScopedState<ob::RealVectorStateSpace> start(space), goal(space);
  std::ranges::copy(p.start, start->values);
  std::ranges::copy(p.goal, goal->values);
  task->setStartAndGoalStates(start, goal);
  if (free.between(p.start, p.goal)) return {};  // asked by both
  og::RRTConnect planner(si);
  // Its distances are Euclidean; ours are the greatest of a joint.
  planner.setRange(cfg.step * std::sqrt(static_cast<double>(n)) / 1.5);
  planner.setNearestNeighbors<ompl::NearestNeighborsLinear>();
  planner.setProblemDefinition(task);
  planner.setup();
  int samples = 0;
  const ob::PlannerStatus status =
      planner.solve(ob::PlannerTerminationCondition([&] { return ++samples > cfg.max_samples; }));
  if (status != ob::PlannerStatus::EXACT_SOLUTION) return {};
  auto& way = *task->getSolutionPath()->as<og::PathGeometric>();
  Shortcuts shortcuts(si, rng);
  shortcuts.shortcutPath(way, cfg.shortcuts, cfg.shortcuts, 0.33, 0);
  std::vector<double> path;
  for (const ob::State* state : way.getStates()) {
    const Config q = view(state, n);
    path.insert(path.end(), q.begin(), q.end());
  }
  return path;
}
#endif

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::nth_element(values, values.begin() + values.size() / 2);
  return values[values.size() / 2];
}

// All problems an iteration.
void ways(benchmark::State& state, Finder find) {
  static Clutter clutter;
  std::vector<Found> all;
  for (auto _ : state) {
    for (int k = 0; k < kProblems; ++k) {
      CollisionQuery query = clutter.ask();
      Found found;
      const FreeSpace free{
          [&](Config q) { return ++found.asked, query.free(q); },
          [&](Config a, Config b) { return ++found.asked, query.free_between(a, b); }};
      Rng rng(k, 0, 0, 0);
      const auto begin = std::chrono::steady_clock::now();
      const std::vector<double> path = find(clutter.joints, clutter.problems[k], free, rng);
      found.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
                     .count();
      found.solved = !path.empty();
      found.length = length_of(path, clutter.joints.size());
      all.push_back(found);
    }
  }
  std::vector<double> ms, asked, length;
  for (const Found& one : all) {
    ms.push_back(one.ms);
    asked.push_back(static_cast<double>(one.asked));
    if (one.solved) length.push_back(one.length);
  }
  state.counters["solved_%"] =
      100.0 * static_cast<double>(length.size()) / static_cast<double>(all.size());
  state.counters["median_ms"] = median(ms);
  state.counters["median_asked"] = median(asked);
  state.counters["median_rad"] = median(length);
}

BENCHMARK_CAPTURE(ways, ours, ours)
    ->Name("Ways/ours")
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);
#ifdef MJSENSE_BENCH_OMPL
BENCHMARK_CAPTURE(ways, ompl, ompls)
    ->Name("Ways/ompl")
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond)
    ->Setup([](const benchmark::State&) { ompl::msg::noOutputHandler(); });
#endif

}  // namespace
}  // namespace mjsense
