// SPDX-License-Identifier: Apache-2.0
// find_path() by OMPL's RRT-Connect and its shortcuts, with the planner's own collision checks;
// every random number comes from the caller's Rng.
#include <ompl/base/ProblemDefinition.h>
#include <ompl/base/ScopedState.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/datastructures/NearestNeighborsLinear.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/PathSimplifier.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>

#include <algorithm>
#include <memory>

#include "mjsense_tasks/policies/planner/joint_path.h"

namespace mjsense::tasks::policies {
namespace {

namespace ob = ompl::base;
namespace og = ompl::geometric;
using Config = std::span<const double>;
using Joints = ob::RealVectorStateSpace;

Config view(const ob::SpaceInformation& info, const ob::State* state) {
  return {state->as<Joints::StateType>()->values, info.getStateDimension()};
}

// Uniform within the limits. RRT-Connect uses only sampleUniform().
class Samples : public ob::StateSampler {
 public:
  Samples(const ob::StateSpace* space, const JointSpace& joints, Rng& rng)
      : StateSampler(space), joints_(joints), rng_(rng) {}
  void sampleUniform(ob::State* state) override {
    double* q = state->as<Joints::StateType>()->values;
    for (std::size_t i = 0; i < joints_.size(); ++i)
      q[i] = rng_.uniform(joints_.low[i], joints_.high[i]);
  }
  void sampleUniformNear(ob::State* state, const ob::State*, double) override {
    sampleUniform(state);
  }
  void sampleGaussian(ob::State* state, const ob::State*, double) override { sampleUniform(state); }

 private:
  const JointSpace& joints_;
  Rng& rng_;
};

// Checks motions between two states, the first of which is known to be free.
class Motions : public ob::MotionValidator {
 public:
  Motions(const ob::SpaceInformationPtr& info, const FreeSpace& free)
      : MotionValidator(info), free_(free) {}
  bool checkMotion(const ob::State* a, const ob::State* b) const override {
    return si_->isValid(b) && free_.between(view(*si_, a), view(*si_, b));
  }
  bool checkMotion(const ob::State* a, const ob::State* b,
                   std::pair<ob::State*, double>&) const override {
    return checkMotion(a, b);
  }

 private:
  const FreeSpace& free_;
};

class Shortcuts : public og::PathSimplifier {
 public:
  Shortcuts(const ob::SpaceInformationPtr& info, Rng& rng) : PathSimplifier(info) {
    rng_.setLocalSeed(rng.next());
  }
};

// Fractions of the path's length: maximum length of a shortcut, and the distance within which its
// ends snap to a waypoint.
constexpr double kReach = 1.0, kSnap = 0.2;

// Removes waypoints whose neighbours have a free straight line between them.
void drop_needless(const ob::SpaceInformation& info, const FreeSpace& is_free,
                   std::vector<ob::State*>& path) {
  for (std::size_t i = 1; i + 1 < path.size();) {
    if (is_free.between(view(info, path[i - 1]), view(info, path[i + 1]))) {
      info.freeState(path[i]);
      path.erase(path.begin() + static_cast<std::ptrdiff_t>(i));
    } else {
      ++i;
    }
  }
}

// Raises OMPL's log level to warnings: by default it logs the start and the result of every search.
void keep_quiet() {
  static const bool once = [] {
    ompl::msg::setLogLevel(std::max(ompl::msg::getLogLevel(), ompl::msg::LOG_WARN));
    return true;
  }();
  static_cast<void>(once);
}

}  // namespace

std::vector<double> find_path(const JointSpace& space, std::span<const double> start,
                              std::span<const double> goal, const FreeSpace& is_free, Rng& rng,
                              const MotionCfg& cfg) {
  std::vector<double> path(start.begin(), start.end());
  if (is_free.between(start, goal)) {
    path.insert(path.end(), goal.begin(), goal.end());
    return path;
  }
  keep_quiet();
  const auto joints = std::make_shared<Joints>(space.size());
  // A joint may be slightly beyond its limit; OMPL would reject such a start.
  ob::RealVectorBounds bounds(space.size());
  for (std::size_t i = 0; i < space.size(); ++i) {
    bounds.low[i] = std::min({space.low[i], start[i], goal[i]});
    bounds.high[i] = std::max({space.high[i], start[i], goal[i]});
  }
  joints->setBounds(bounds);
  joints->setStateSamplerAllocator(
      [&](const ob::StateSpace* s) { return std::make_shared<Samples>(s, space, rng); });
  const auto info = std::make_shared<ob::SpaceInformation>(joints);
  // Start and goal are valid even if they are in contact with something.
  info->setStateValidityChecker([&](const ob::State* state) {
    const Config q = view(*info, state);
    return std::ranges::equal(q, start) || std::ranges::equal(q, goal) || is_free.at(q);
  });
  info->setMotionValidator(std::make_shared<Motions>(info, is_free));
  info->setup();

  ob::ScopedState<Joints> from(joints), to(joints);
  std::ranges::copy(start, from->values);
  std::ranges::copy(goal, to->values);
  const auto problem = std::make_shared<ob::ProblemDefinition>(info);
  problem->setStartAndGoalStates(from, to);
  og::RRTConnect planner(info);
  planner.setRange(cfg.step);
  // OMPL's other structures, for larger trees, use their own random numbers.
  planner.setNearestNeighbors<ompl::NearestNeighborsLinear>();
  planner.setProblemDefinition(problem);
  int samples = 0;
  const ob::PlannerTerminationCondition enough([&] { return ++samples > cfg.max_samples; });
  if (planner.solve(enough) != ob::PlannerStatus::EXACT_SOLUTION) return {};

  auto& solution = *problem->getSolutionPath()->as<og::PathGeometric>();
  // These numbers gave the lowest sum of planning time and motion time for 100 paths in clutter
  // (joint_path_bench.cc).
  Shortcuts shortcuts(info, rng);
  shortcuts.reduceVertices(solution);
  shortcuts.shortcutPath(solution, cfg.shortcuts, cfg.shortcuts, kReach, kSnap);
  drop_needless(*info, is_free, solution.getStates());
  path.clear();
  for (const ob::State* state : solution.getStates()) {
    const Config q = view(*info, state);
    path.insert(path.end(), q.begin(), q.end());
  }
  return path;
}

}  // namespace mjsense::tasks::policies
