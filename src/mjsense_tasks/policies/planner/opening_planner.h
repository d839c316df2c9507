// SPDX-License-Identifier: Apache-2.0
#pragma once
// Planner of opening and closing: grasps the handle of an OpeningTask's target and moves it along
// its arc or line.

#include "mjsense_tasks/policies/planner/task_planner.h"
#include "mjsense_tasks/tasks/opening/opening.h"

namespace mjsense::tasks::policies {

struct OpeningPlannerCfg {
  // m/s, speed of the tool: to the pregrasp, with the handle, with the handle while the base
  // drives, to the handle
  double approach_speed = 0.20, fast = 0.08, driving = 0.12, slow = 0.04;
  // m/s, of a floating hand that pushes something shut; it starts and ends at rest, so that with
  // `fast` half of the fridges were not shut within the horizon
  double push = 0.15;
  double fastest_joint = 0.8;                  // rad/s
  double base_speed = 0.20, base_turn = 0.35;  // m/s, rad/s, with the handle
  double turn = 1.0;                           // rad/s, of a floating hand
  double settle = 0.1, close_time = 0.5;       // s
  double back = 0.08;                          // m, retreat before a retry
  int grasps = 40;                             // maximum number of grasps that are tried
};

class OpeningPlanner final : public TaskPlanner {
 public:
  explicit OpeningPlanner(OpeningPlannerCfg cfg = {}, TaskPlannerCfg planner = {})
      : TaskPlanner(planner), cfg_(cfg) {}
  std::span<const episode::Phase> phases() const override;

 protected:
  void initialize_planner() override;  // throws ValueError for another task, or without a hand
  void make_plan(const World& world, const PlanRequest& request, Plan& plan) override;
  int first_phase() const override;

 private:
  std::vector<CommandPath> paths(int arm, std::span<const robots::RobotValues> points, double speed,
                                 bool driving) const;
  // Adds a screw of a floating hand, X_WT.
  Segment& add_move(Plan& plan, int phase, const tasks::OrientedHand& hand, const Pose& from,
                    const Pose& to, double speed, double settle = 0) const;
  void plan_floating(const World& world, const tasks::HandlePath& path, bool with_approach,
                     Plan& plan) const;
  void back_off(const World& world, Plan& plan) const;

  OpeningPlannerCfg cfg_;
  const tasks::OpeningTask* opening_ = nullptr;
  std::vector<tasks::HandlePath> paths_;  // [B] the path that is followed
};

}  // namespace mjsense::tasks::policies
