// SPDX-License-Identifier: Apache-2.0
#pragma once
// Planner of navigation: drives to a pose from which the head camera sees an object of the wanted
// kind, by A* over the floor that the model's geoms leave free. It has one phase, 0. If the object
// is not visible on arrival (an arm may occlude it), the base turns sideways, then drives
// elsewhere.

#include <string>
#include <vector>

#include "mjsense_tasks/policies/planner/task_planner.h"
#include "mjsense_tasks/scenes/base_planner.h"

namespace mjsense::tasks {
class NavToObjTask;
}  // namespace mjsense::tasks

namespace mjsense::tasks::policies {

struct NavPlannerCfg {
  double arrive = 1.1;   // m, distance to the object at the goal
  double reach = 1.4;    // m, maximum distance if the base cannot come closer
  double facing = 0.45;  // rad, maximum angle between heading and object
  double astray = 0.35;  // m, distance of the base from its command that triggers a new plan
  scenes::BaseSpeeds speeds;
};

class NavPlanner final : public TaskPlanner {
 public:
  explicit NavPlanner(NavPlannerCfg cfg = {}) : cfg_(cfg) {}
  std::span<const episode::Phase> phases() const override;
  bool has_grasp_pose() const override { return false; }

 protected:
  void initialize_planner() override;
  void make_plan(const World& world, const PlanRequest& request, Plan& plan) override;
  bool gone_wrong(const World& world) const override;

 private:
  scenes::BasePose base_pose(const World& world) const {
    return scenes::BasePose::of(robot().base_pose(world));
  }
  bool is_goal_pose(const World& world, const scenes::BasePose& there, const Pose& camera_in_base,
                    double arrive, double facing) const;

  NavPlannerCfg cfg_;
  const tasks::NavToObjTask* nav_ = nullptr;
  int group_ = -1;  // move group of the base
  std::vector<std::vector<scenes::BasePose>>
      tried_;                   // [B] poses from which the object was not visible
  std::vector<double> enough_;  // [B] m, distance to the object at which the base has arrived
};

// Timed path of the base group's commands (x, y, yaw) through the poses `poses`.
CommandPath base_path(int group, std::span<const scenes::BasePose> poses,
                      const scenes::BaseSpeeds& speeds);

}  // namespace mjsense::tasks::policies
