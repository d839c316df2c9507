// SPDX-License-Identifier: Apache-2.0
#pragma once
// Planner of picks from above, for a task with a GraspScene: open, pregrasp, grasp, settle, close,
// lift.

#include <memory>

#include "mjsense_tasks/episode/grasp_scene.h"
#include "mjsense_tasks/policies/planner/grasp.h"
#include "mjsense_tasks/policies/planner/task_planner.h"

namespace mjsense::tasks::policies {

struct PickPlannerCfg {
  TaskPlannerCfg planner;
  double fast = 0.20, slow = 0.08;        // m/s, of the tool
  double pregrasp_height = 0.04;          // m above the grasp, world z
  double lift_height = 0.08;              // m above the grasp, world z
  double settle = 0.1, close_time = 0.5;  // s
  int max_ik_candidates = 256;            // maximum number of grasps that are tried
};

class PickPlanner final : public TaskPlanner {
 public:
  explicit PickPlanner(PickPlannerCfg cfg = {}) : TaskPlanner(cfg.planner), cfg_(cfg) {}
  std::span<const episode::Phase> phases() const override;

 protected:
  // Throws ValueError for a task without a GraspScene, and unless the joints of the robot's arm
  // alone move its gripper.
  void initialize_planner() override;
  void make_plan(const World& world, const PlanRequest& request, Plan& plan) override;
  int first_phase() const override;

 private:
  // Returns false, and the reason in `why`, if no grasp is possible.
  bool choose_grasp(const World& world, Grasp& chosen, std::string& why) const;
  bool reachable(const Pose& base, const Pose& grasp, robots::RobotValues joints) const;
  bool path_is_free(const World& world, const Pose& tool, const Pose& pregrasp) const;

  PickPlannerCfg cfg_;
  const episode::GraspScene* scene_ = nullptr;
  std::unique_ptr<GripperShape> gripper_shape_;
};

}  // namespace mjsense::tasks::policies
