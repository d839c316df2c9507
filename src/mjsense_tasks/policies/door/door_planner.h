// SPDX-License-Identifier: Apache-2.0
#pragma once
// Planner of door opening: drives to the door, grasps the handle, presses it, and pulls or pushes
// the door along its arc with arm and base together.

#include <memory>
#include <string>
#include <vector>

#include "mjsense_tasks/policies/door/door_motion.h"
#include "mjsense_tasks/policies/planner/task_planner.h"

namespace mjsense::tasks {
class DoorOpeningTask;
}  // namespace mjsense::tasks

namespace mjsense::tasks::policies {

struct DoorPlannerCfg {
  double open = 0.76;    // goal, fraction of the door's range
  double enough = 0.70;  // goal if `open` is not possible from any base pose
  double margin = 0.03;  // m, clearance of the base from walls and leaf while it moves the door
  double tight = 0.01;   // clearance if the base does not fit through the doorway with `margin`
  double lag = 0.15;     // fraction by which the door may lag before the planner retries
  // rad/s, joint speed of the arm: to the pregrasp, to the handle, pressing, moving the door
  double reach_speed = 1.2, slow_speed = 0.6, press_speed = 0.5, joint_speed = 0.9;
  double leaf_speed = 0.28;  // rad/s
  double close_time = 0.7;   // s
  scenes::BaseSpeeds speeds{0.4, 0.7, 0.4, 0.8};
  double base_speed = 0.16, base_turn = 0.3;  // m/s, rad/s, while moving the door
  int max_places = 60;                        // base poses that are tried
};

class DoorPlanner final : public TaskPlanner {
 public:
  enum PhaseNumber { kNavigate, kPregrasp, kReach, kGrasp, kOpen, kRelease, kComplete, kRecovery };

  explicit DoorPlanner(DoorPlannerCfg cfg = {}) : cfg_(cfg) {}
  std::span<const episode::Phase> phases() const override;

 protected:
  void initialize_planner() override;
  void make_plan(const World& world, const PlanRequest& request, Plan& plan) override;
  bool gone_wrong(const World& world) const override;

 private:
  struct Expected {
    int segment;
    double fraction;
  };
  scenes::BasePose base_pose(const World& world) const {
    return scenes::BasePose::of(robot().base_pose(world));
  }
  double remaining_leaf_angle(const World& world, double goal) const;
  void recover(const World& world, Plan& plan) const;
  bool approach(const World& world, double goal, double margin, Plan& plan);
  void tuck(const World& world, const robots::Hand& hand, Segment& segment) const;
  CommandPath arm_path(const World& world, int arm, std::span<const double> to,
                       double seconds) const;
  std::vector<double> measured(const World& world, int arm) const;  // joint positions
  void open_door(const World& world, const DoorMotion& motion, Plan& plan);
  std::vector<double> seconds(std::span<const DoorWaypoint> waypoints, std::span<const double> from,
                              const scenes::BasePose& at, double joint_speed) const;
  void add_path(Plan& plan, int phase, const DoorMotion& motion,
                std::span<const DoorWaypoint> waypoints, std::span<const double> seconds,
                std::vector<double>& from, scenes::BasePose& at) const;

  DoorPlannerCfg cfg_;
  const tasks::DoorOpeningTask* door_ = nullptr;
  int group_ = -1;  // move group of the base
  std::unique_ptr<DoorMotions> motions_;
  std::vector<int> tool_;       // [B] arm that is to grasp the handle
  std::vector<double> goal_;    // [B] goal, fraction of the door's range
  std::vector<double> margin_;  // [B] m, clearance of the base while it moves the door
  // [B] opening fraction expected at the start of each segment
  std::vector<std::vector<Expected>> expected_;
};

}  // namespace mjsense::tasks::policies
