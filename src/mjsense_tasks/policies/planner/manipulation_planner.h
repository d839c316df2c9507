// SPDX-License-Identifier: Apache-2.0
#pragma once
// Planner of picking and placing: picks the target of a task with a GraspScene, from any direction,
// and puts it where the task's PlaceScene says. Paths are checked for collisions, including the
// held object. With several hands the nearest one picks. The plan has stages: pick; place, planned
// from the object's actual pose in the hand; check of success, with a retry if it fails. If no path
// exists, the arms return to their start positions, and a mobile base drives to a pose with a path;
// these are separate stages.

#include <optional>
#include <vector>

#include "mjsense_tasks/policies/planner/base_reposition.h"
#include "mjsense_tasks/policies/planner/picking.h"

namespace mjsense::tasks::policies {

class ManipulationPlanner final : public TaskPlanner {
 public:
  explicit ManipulationPlanner(ManipulationPlannerCfg cfg = {})
      : TaskPlanner(cfg.planner), cfg_(cfg) {}
  std::span<const episode::Phase> phases() const override;

 protected:
  void initialize_planner() override;  // throws ValueError without a GraspScene or a hand
  void make_plan(const World& world, const PlanRequest& request, Plan& plan) override;
  int first_phase() const override;
  bool gone_wrong(const World& world) const override;

 private:
  struct State {
    std::optional<Picking::Grip> grip;  // of the last pick, until it fails
    bool holding = false;
    Placing::Home home;  // pose at the start of the episode
    FailedGrasps failed;
    // Since the start of the attempt.
    int inserted = 0;  // stages that only prepare the next one
    bool went_home = false, drove_to_pick = false, drove_to_place = false;
  };
  void plan_open_grippers(Plan& plan) const;
  static bool insert(State& state);
  bool plan_pick(const World& world, const PlanRequest& request, Plan& plan);
  bool plan_place(const World& world, const PlanRequest& request, Plan& plan);

  ManipulationPlannerCfg cfg_;
  std::optional<Manipulation> shared_;
  std::optional<Placing> placing_;  // if the task has a PlaceScene
  std::optional<Picking> picking_;
  std::optional<BaseReposition> shift_;  // if the robot has a mobile base
  std::vector<State> states_;            // [B]
};

}  // namespace mjsense::tasks::policies
