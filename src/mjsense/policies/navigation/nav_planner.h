// SPDX-License-Identifier: Apache-2.0
#pragma once
// Drives to where the head camera sees an object of the wanted kind: A* over the floor that the
// model's geoms leave free. Its only phase is 0. Where the object is not seen on arrival - the arm is
// in the way - it looks aside, then goes elsewhere.

#include <string>
#include <vector>

#include "mjsense/policies/planner/task_planner.h"
#include "mjsense/scenes/base_route.h"

namespace mjsense {

class NavToObjTask;

struct NavPlannerCfg {
  double arrive = 1.1;   // m, from the object
  double reach = 1.4;    // m, at most, where one does not come nearer
  double facing = 0.45;  // rad, the object off the heading, at most
  double astray = 0.35;  // m, the base from its command: it plans again
  BaseSpeeds speeds;
};

class NavPlanner final : public TaskPlanner {
 public:
  explicit NavPlanner(NavPlannerCfg cfg = {}) : cfg_(cfg) {}
  std::span<const Phase> phases() const override;
  bool has_grasp_pose() const override { return false; }

 protected:
  void initialize_planner() override;
  void make_plan(const World& world, const PlanRequest& request, Plan& plan) override;
  bool gone_wrong(const World& world) const override;

 private:
  BasePose base(const World& world) const;
  bool would_do(const World& world, const BasePose& there, const Pose& camera_in_base,
                double arrive, double facing) const;

  NavPlannerCfg cfg_;
  const NavToObjTask* nav_ = nullptr;
  int group_ = -1;                            // of the base
  std::vector<std::vector<BasePose>> tried_;  // [B] where nothing was seen
};

// A path of the group's commands along the way; commands are x, y, yaw.
CommandPath base_path(int group, std::span<const BasePose> way, const BaseSpeeds& speeds);

}  // namespace mjsense
