// SPDX-License-Identifier: Apache-2.0
#pragma once
// A planner for one kind of task: a class that makes plans. Following them, noticing that they fail,
// beginning again, giving up and the end are here.
//
//   class MyPlanner final : public TaskPlanner {
//     std::span<const Phase> phases() const override { ... }
//     void initialize_planner() override { ... }                   task() and robot() are there
//     void make_plan(const World& world, const PlanRequest& request, Plan& plan) override {
//       plan.move_tool(kReach, hand.tool, tool_target(world, hand.tool), goal, 0.2).grip(...);
//     }
//   };

#include <vector>

#include "mjsense/episode/policy.h"
#include "mjsense/episode/task.h"
#include "mjsense/policies/planner/follower.h"

namespace mjsense {

struct TaskPlannerCfg {
  FollowerCfg follower;
  int max_retries = 3;
};

struct PlanRequest {
  int attempt = 0;  // how often it has begun again in this episode
  int stage = 0;    // how often Plan::more has been asked for since then
};

// Commands the groups that its plans name; the others hold. An action that gives up is {done,
// success: false} without commands; before a retry it comes to rest, in a step at least.
class TaskPlanner : public PlannerPolicy {
 public:
  explicit TaskPlanner(TaskPlannerCfg cfg = {}) : planner_cfg_(cfg), follower_(cfg.follower) {}
  std::string_view name() const override { return "planner"; }
  void initialize(Task& task) final;
  void reset(const World& world) final;
  void act(const World& world, Action& action) final;

  int phase(int world) const override { return follower_.phase(world); }
  int num_retries(int world) const override { return states_[world].retries; }
  std::string failure(int world) const override;
  Pose grasp_pose(int world) const override { return follower_.plan(world).grasp; }
  // Why it last began again or gave up; kNone if it never did.
  PlanFailure last_failure(int world) const { return states_[world].failure; }

 protected:
  // Throws ValueError for a task or a robot with which it can do nothing.
  virtual void initialize_planner() = 0;
  // Fills an empty plan for the world as it stands; no segments: there is no way, it gives up, or
  // begins again where that was not the first stage, and plan.refusal says why. Worlds plan in
  // parallel.
  virtual void make_plan(const World& world, const PlanRequest& request, Plan& plan) = 0;
  // Phase while the first plan is made.
  virtual int first_phase() const { return 0; }
  // A further reason to begin again, looked for in every step.
  virtual bool gone_wrong(const World& /*world*/) const { return false; }

  Task& task() const { return *task_; }
  const Robot& robot() const { return task_->robot(); }
  const Follower& follower() const { return follower_; }
  // Where a plan begins, X_BT: what is commanded, or where the tool is.
  Pose tool_target(const World& world, int tool) const {
    return follower_.tool_target(world, tool);
  }

 private:
  struct State {
    bool planned = false;
    bool stops = false;     // before it begins again
    bool gives_up = false;  // instead, once it is at rest
    int retries = 0, stage = 0;
    PlanFailure failure = PlanFailure::kNone;
    bool no_other_way = false;  // and to begin again there was no plan
    std::string refusal;        // why there was no plan, the last time that there was none
  };
  bool plan(const World& world);
  void begin_again(const World& world, Action& action);
  static void give_up(Action& action);

  TaskPlannerCfg planner_cfg_;
  Task* task_ = nullptr;
  Follower follower_;
  std::vector<State> states_;  // [B]
};

}  // namespace mjsense
