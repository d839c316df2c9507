// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/task_planner.h"

namespace mjsense::tasks::policies {
namespace {

const char* text_of(PlanFailure failure) {
  switch (failure) {
    case PlanFailure::kNone:
      return "";
    case PlanFailure::kUnplanned:
      return "found no plan";
    case PlanFailure::kToolAway:
      return "the tool deviated from its path";
    case PlanFailure::kToolTurned:
      return "the tool's rotation deviated from its path";
    case PlanFailure::kDropped:
      return "the hand held nothing";
    case PlanFailure::kUnreachable:
      return "the arm could not reach all of its path";
    case PlanFailure::kAstray:
      return "the motion deviated from the plan";
  }
  return "";
}

}  // namespace

void TaskPlanner::initialize(episode::Task& task) {
  task_ = &task;
  follower_.initialize(task.robot(), task.model(), task.num_worlds(),
                       0.001 * task.cfg().policy_dt_ms);
  follower_.check_commands(task.model());
  states_.assign(task.num_worlds(), {});
  initialize_planner();
}

void TaskPlanner::reset(const World& world) {
  states_[world.id] = {};
  follower_.plan(world.id).grasp = {};
  follower_.reset(world);
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
  if (!state.planned) state.rejection = plan.rejection;
  return state.planned;
}

void TaskPlanner::replan(const World& world, robots::Action& action) {
  State& state = states_[world.id];
  state.planned = false;
  state.stops = true;
  state.gives_up = state.retries == planner_cfg_.max_retries;
  if (!state.gives_up) {
    ++state.retries;
    state.stage = 0;
  }
  follower_.brake(world, action);
}

std::string TaskPlanner::failure(int world) const {
  const State& state = states_[world];
  std::string text = text_of(state.failure);
  const bool unplanned = state.failure == PlanFailure::kUnplanned;
  if (state.no_other_path && !unplanned) text += ", then it found no plan";
  if ((state.no_other_path || unplanned) && !state.rejection.empty())
    text += " (" + state.rejection + ")";
  return text;
}

void TaskPlanner::give_up(robots::Action& action) {
  action.done = true;
  action.success = false;
}

void TaskPlanner::act(const World& world, robots::Action& action) {
  State& state = states_[world.id];
  action = {};
  if (state.stops) {
    if (!follower_.brake(world, action)) return;
    state.stops = false;
    if (state.gives_up) return give_up(action);
    action = {};
    follower_.restart(world);
    state.no_other_path = !plan(world);
  }
  if (state.planned && !follower_.finished(world.id)) {
    PlanFailure failure = follower_.failure(world);
    if (failure == PlanFailure::kNone && gone_wrong(world)) failure = PlanFailure::kAstray;
    if (failure != PlanFailure::kNone) {
      state.failure = failure;
      return replan(world, action);
    }
  }
  if (!state.planned) return give_up(action);
  follower_.follow(world, action);
  while (follower_.finished(world.id) && follower_.plan(world.id).more) {
    ++state.stage;
    if (!plan(world)) {
      state.failure = PlanFailure::kUnplanned;
      action = {};
      return replan(world, action);
    }
    follower_.follow(world, action);
  }
  action.done = follower_.finished(world.id);
}

}  // namespace mjsense::tasks::policies
