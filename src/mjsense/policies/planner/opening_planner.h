// SPDX-License-Identifier: Apache-2.0
#pragma once
// Opens and closes: takes the handle of an OpeningTask's target and goes with it along its arc or
// line.

#include "mjsense/policies/planner/task_planner.h"
#include "mjsense/tasks/opening/opening.h"

namespace mjsense {

struct OpeningPlannerCfg {
  // m/s, of the tool: to the pregrasp, with the handle, with it while the base drives, to the handle
  double there = 0.20, fast = 0.08, driving = 0.12, slow = 0.04;
  double fastest_joint = 0.8;                  // rad/s on the way there
  double base_speed = 0.20, base_turn = 0.35;  // m/s, rad/s, with the handle
  double turn = 1.0;                           // rad/s, of a hand that floats
  double settle = 0.1, close_time = 0.5;       // s
  double back = 0.08;                          // m, before another attempt
  int grasps = 40;                             // tried before giving up
};

class OpeningPlanner final : public TaskPlanner {
 public:
  explicit OpeningPlanner(OpeningPlannerCfg cfg = {}, TaskPlannerCfg planner = {})
      : TaskPlanner(planner), cfg_(cfg) {}
  std::span<const Phase> phases() const override;

 protected:
  void initialize_planner() override;  // throws ValueError for another task, or without a hand
  void make_plan(const World& world, const PlanRequest& request, Plan& plan) override;
  int first_phase() const override;

 private:
  std::vector<CommandPath> paths(int arm, std::span<const RobotValues> points, double speed,
                                 bool driving) const;
  // A screw of a hand that floats, X_WT.
  Segment& go(Plan& plan, int phase, const ArmAndHand& hand, const Pose& from, const Pose& to,
              double speed, double settle = 0) const;
  void float_along(const World& world, const HandleWay& way, bool there, Plan& plan) const;
  void back_off(const World& world, Plan& plan) const;

  OpeningPlannerCfg cfg_;
  const OpeningTask* opening_ = nullptr;
  std::vector<HandleWay> ways_;  // [B] what the arm is at
};

}  // namespace mjsense
