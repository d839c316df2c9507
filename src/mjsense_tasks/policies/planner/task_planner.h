// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base class of planners for one kind of task. A subclass makes plans; this class follows them,
// detects failures, retries, gives up and ends the episode.
//
//   class MyPlanner final : public TaskPlanner {
//     std::span<const Phase> phases() const override { ... }
//     void initialize_planner() override { ... }          // task() and robot() are available
//     void make_plan(const World& world, const PlanRequest& request, Plan& plan) override {
//       plan.move_tool(kReach, hand.tool, tool_target(world, hand.tool), goal, 0.2).grip(...);
//     }
//   };

#include <vector>

#include "mjsense_tasks/episode/policy.h"
#include "mjsense_tasks/episode/task.h"
#include "mjsense_tasks/policies/planner/plan_follower.h"

namespace mjsense::tasks::policies {

struct TaskPlannerCfg {
  FollowerCfg follower;
  int max_retries = 3;
};

struct PlanRequest {
  int attempt = 0;  // number of retries so far in this episode
  int stage = 0;    // number of further stages requested by Plan::more in this attempt
};

// Commands the groups that its plans name; the others hold. Giving up is the action {done, success:
// false} without commands. Before a retry the robot comes to rest, which takes at least one step.
class TaskPlanner : public episode::PlannerPolicy {
 public:
  explicit TaskPlanner(TaskPlannerCfg cfg = {}) : planner_cfg_(cfg), follower_(cfg.follower) {}
  std::string_view name() const override { return "planner"; }
  void initialize(episode::Task& task) final;
  void reset(const World& world) final;
  void act(const World& world, robots::Action& action) final;

  int phase(int world) const override { return follower_.phase(world); }
  int num_retries(int world) const override { return states_[world].retries; }
  std::string failure(int world) const override;
  std::vector<episode::PlannedPath> planned_paths(const World& world) const override;
  Pose grasp_pose(int world) const override { return follower_.plan(world).grasp; }
  // Reason of the last retry or of giving up; kNone if there was none.
  PlanFailure last_failure(int world) const { return states_[world].failure; }

 protected:
  // Throws ValueError for an unsupported task or robot.
  virtual void initialize_planner() = 0;
  // Fills an empty plan for the current state of the world. No segments mean that there is no plan:
  // the planner gives up, or retries if this was not the first stage; plan.rejection is the reason.
  // Calls for different worlds run in parallel.
  virtual void make_plan(const World& world, const PlanRequest& request, Plan& plan) = 0;
  // Phase while the first plan is made.
  virtual int first_phase() const { return 0; }
  // A further reason for a retry, checked in every step.
  virtual bool gone_wrong(const World& /*world*/) const { return false; }

  episode::Task& task() const { return *task_; }
  const robots::Robot& robot() const { return task_->robot(); }
  const Follower& follower() const { return follower_; }
  // X_BT at the start of a plan: commanded or, without a command, measured.
  Pose tool_target(const World& world, int tool) const {
    return follower_.tool_target(world, tool);
  }

 private:
  struct State {
    bool planned = false;
    bool stops = false;     // coming to rest before a retry
    bool gives_up = false;  // gives up instead, once at rest
    int retries = 0, stage = 0;
    PlanFailure failure = PlanFailure::kNone;
    bool no_other_path = false;  // the retry found no plan
    std::string rejection;       // reason of the last time that no plan was found
  };
  bool plan(const World& world);
  void replan(const World& world, robots::Action& action);
  static void give_up(robots::Action& action);

  TaskPlannerCfg planner_cfg_;
  episode::Task* task_ = nullptr;
  Follower follower_;
  std::vector<State> states_;  // [B]
};

}  // namespace mjsense::tasks::policies
