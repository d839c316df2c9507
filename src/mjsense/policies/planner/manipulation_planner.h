// SPDX-License-Identifier: Apache-2.0
#pragma once
// Picks up the target of a task that has a GraspScene, from any direction, and puts it where the task's PlaceScene
// says. The way to the object is free of everything, the object in the hand included. With several hands the
// nearest takes it. The plan has stages: pick; place, from where the object is in the hand; a look at
// whether it is done - if not, it begins again. Where there is no way from here, arms go to where they began, and a
// base that drives goes to where there is one; these are stages of their own.

#include <optional>
#include <vector>

#include "mjsense/policies/planner/base_shift.h"
#include "mjsense/policies/planner/picking.h"

namespace mjsense {

class ManipulationPlanner final : public TaskPlanner {
 public:
  explicit ManipulationPlanner(ManipulationPlannerCfg cfg = {})
      : TaskPlanner(cfg.planner), cfg_(cfg) {}
  std::span<const Phase> phases() const override;

 protected:
  void initialize_planner() override;  // throws ValueError without a GraspScene or a hand
  void make_plan(const World& world, const PlanRequest& request, Plan& plan) override;
  int first_phase() const override;
  bool gone_wrong(const World& world) const override;

 private:
  struct State {
    std::optional<Picking::Grip> grip;  // of the last plan to pick, until it has failed
    bool holding = false;
    Placing::Home home;  // the start of the episode
    FailedGrasps failed;
    // Since it began, or began again.
    int inserted = 0;  // stages that only lead to where the next can be done
    bool went_home = false, drove_to_pick = false, drove_to_place = false;
  };
  void let_go(Plan& plan) const;
  static bool insert(State& state);
  bool plan_pick(const World& world, const PlanRequest& request, Plan& plan);
  bool plan_place(const World& world, const PlanRequest& request, Plan& plan);

  ManipulationPlannerCfg cfg_;
  std::optional<Manipulation> shared_;
  std::optional<Placing> placing_;  // of a task with a PlaceScene
  std::optional<Picking> picking_;
  std::optional<BaseShift> shift_;  // of a robot whose base drives
  std::vector<State> states_;       // [B]
};

}  // namespace mjsense
