// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/manipulation_planner.h"

#include <fmt/format.h>

#include "mjsense_tasks/policies/planner/phases.h"

namespace mjsense::tasks::policies {
namespace {

constexpr double kSlipped = 0.05;  // m, displacement of the object in the hand since the grasp

}  // namespace

std::span<const episode::Phase> ManipulationPlanner::phases() const { return kManipulationPhases; }

int ManipulationPlanner::first_phase() const { return kOpenGripper; }

void ManipulationPlanner::initialize_planner() {
  picking_.reset();
  placing_.reset();
  shared_.emplace(task(), cfg_);
  if (shared_->scene().place_scene()) placing_.emplace(*shared_);
  picking_.emplace(*shared_, placing_ ? &*placing_ : nullptr);
  shift_.reset();
  if (scenes::driving_base(robot()) >= 0) shift_.emplace(task().model(), robot());
  states_.assign(task().num_worlds(), {});
}

bool ManipulationPlanner::gone_wrong(const World& world) const {
  const State& state = states_[world.id];
  if (!state.holding) return false;
  const int phase = follower().phase(world.id);
  if (phase != kLift && phase != kPreplace && phase != kPlace) return false;
  // A released object may roll away.
  const auto& segments = follower().plan(world.id).segments;
  const auto segment = static_cast<std::size_t>(follower().segment(world.id));
  if (segment >= segments.size() || segments[segment].holding.empty()) return false;
  const robots::Hand& hand = shared_->hand(state.grip->hand).hand();
  const Pose object = inverse(robot().leaf_pose(world, hand.tool)) * shared_->object_pose(world);
  return norm(object.p - state.grip->tool_object.p) > kSlipped;
}

void ManipulationPlanner::make_plan(const World& world, const PlanRequest& request, Plan& plan) {
  State& state = states_[world.id];
  if (request.stage == 0) {
    if (request.attempt == 0) {
      state = {};
      state.home.joints = follower().joints(world.id);
    }
    state.inserted = 0;
    state.went_home = state.drove_to_pick = state.drove_to_place = false;
  }
  // After a failure the hands open, and the object comes to rest before the next pick is planned.
  const int stage = request.stage - state.inserted - (request.attempt == 0 ? 0 : 1);
  if (stage < 0) {
    state.holding = false;
    if (state.grip) state.failed.add(inverse(state.grip->tool_object));
    state.grip.reset();
    plan_open_grippers(plan);
  } else if (stage == 0) {
    plan.more = plan_pick(world, request, plan);
  } else if (stage == 1 && placing_) {
    plan.more = plan_place(world, request, plan);
  } else if (const episode::Evaluation now = task().evaluate(world); now.success) {
    plan.wait(placing_ ? kUnknownPhase : kLift, 0);
  } else {
    plan.rejection = fmt::format("after the last motion, {}", now.missing);
  }
}

void ManipulationPlanner::plan_open_grippers(Plan& plan) const {
  Segment& open = plan.wait(kOpenGripper, cfg_.close_time);
  for (int h = 0; h < shared_->num_hands(); ++h)
    open.grip(shared_->hand(h).hand().gripper,
              shared_->gripper_group(shared_->hand(h)).open_command);
  plan.more = true;
}

// Counts a plan that only prepares the next one, for the same stage.
bool ManipulationPlanner::insert(State& state) {
  ++state.inserted;
  return true;
}

bool ManipulationPlanner::plan_pick(const World& world, const PlanRequest& request, Plan& plan) {
  State& state = states_[world.id];
  state.grip = picking_->plan(world, request, follower(), state.failed, plan);
  if (state.grip) {
    if (request.attempt == 0) state.home.tool = state.grip->start;
    return true;
  }
  if (request.attempt > 0 && !state.went_home) {
    state.went_home = true;
    picking_->plan_return_home(world, request, follower(), state.home.joints, plan);
    if (!plan.segments.empty()) return insert(state);
  }
  if (!shift_ || state.drove_to_pick) return false;
  state.drove_to_pick = true;
  const auto picks = [&](const World& there) {
    return picking_->can(there, request, follower(), state.failed);
  };
  return shift_->plan(world, kPregrasp, {}, picks, plan) && insert(state);
}

bool ManipulationPlanner::plan_place(const World& world, const PlanRequest& request, Plan& plan) {
  State& state = states_[world.id];
  HandPlanner& hand = shared_->hand(state.grip->hand);
  const Pose tool_object =
      inverse(robot().leaf_pose(world, hand.hand().tool)) * shared_->object_pose(world);
  if (norm(tool_object.p - state.grip->tool_object.p) > kSlipped) {
    plan.rejection = "the object moved in the hand while it was lifted";
    return false;
  }
  state.grip->tool_object = tool_object;
  state.holding = true;
  if (placing_->plan(world, request, follower(), hand, tool_object, state.home, plan)) return true;
  if (shift_ && !state.drove_to_place) {
    state.drove_to_place = true;
    const auto places = [&](const World& there) {
      Plan unused;
      return placing_->reaches(there, hand, hand.now(there, follower())) &&
             placing_->plan(there, request, follower(), hand, tool_object, state.home, unused);
    };
    const BaseReposition::Held held{hand.hand(), shared_->target_body(world.id), tool_object};
    if (shift_->plan(world, kPreplace, held, places, plan)) return insert(state);
  }
  return placing_->put_back(world, follower(), hand, tool_object, plan);
}

}  // namespace mjsense::tasks::policies
