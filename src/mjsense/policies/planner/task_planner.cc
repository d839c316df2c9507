// SPDX-License-Identifier: Apache-2.0
#include "mjsense/policies/planner/task_planner.h"

namespace mjsense {

void TaskPlanner::initialize(Task& task) {
  task_ = &task;
  follower_.initialize(task.robot(), task.model(), task.num_worlds());
  states_.assign(task.num_worlds(), {});
  initialize_planner();
}

void TaskPlanner::reset(const World& world) {
  states_[world.id] = {};
  follower_.plan(world.id).grasp = {{0, 0, 0}, {0, 0, 0, 0}};
  follower_.restart(world);
  if (!plan(world)) states_[world.id].failure = PlanFailure::kUnplanned;
}

bool TaskPlanner::plan(const World& world) {
  State& state = states_[world.id];
  Plan& plan = follower_.plan(world.id);
  plan.clear();
  if (state.stage == 0) follower_.set_phase(world.id, first_phase());
  make_plan(world, {state.retries, state.stage}, plan);
  follower_.begin(world);
  state.planned = !plan.segments.empty();
  return state.planned;
}

bool TaskPlanner::begin_again(const World& world) {
  State& state = states_[world.id];
  if (state.retries >= planner_cfg_.max_retries) return false;
  ++state.retries;
  state.stage = 0;
  follower_.restart(world);
  return plan(world);
}

void TaskPlanner::give_up(Action& action) {
  action.done = true;
  action.success = false;
}

void TaskPlanner::act(const World& world, Action& action) {
  State& state = states_[world.id];
  action = {};
  if (state.planned && !follower_.finished(world.id)) {
    PlanFailure failure = follower_.failure(world);
    if (failure == PlanFailure::kNone && gone_wrong(world)) failure = PlanFailure::kUnplanned;
    if (failure != PlanFailure::kNone) {
      state.failure = failure;
      state.planned = begin_again(world);
      if (state.planned) return;  // hold for this step
    }
  }
  if (!state.planned) return give_up(action);
  follower_.follow(world, action);
  while (follower_.finished(world.id) && follower_.plan(world.id).more) {
    ++state.stage;
    if (!plan(world)) {
      state.failure = PlanFailure::kUnplanned;
      action = {};
      state.planned = begin_again(world);
      if (!state.planned) give_up(action);
      return;
    }
    follower_.follow(world, action);
  }
  action.done = follower_.finished(world.id);
}

}  // namespace mjsense
