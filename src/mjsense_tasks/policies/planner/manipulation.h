// SPDX-License-Identifier: Apache-2.0
#pragma once
// State shared by picking (picking.h) and placing (placing.h): configuration, the robot's hands,
// the target object, clearances.

#include <memory>
#include <string_view>
#include <vector>

#include "mjsense_tasks/episode/grasp_scene.h"
#include "mjsense_tasks/policies/planner/grasp.h"
#include "mjsense_tasks/policies/planner/hand_planner.h"
#include "mjsense_tasks/policies/planner/task_planner.h"

namespace mjsense::tasks::policies {

struct ManipulationPlannerCfg {
  TaskPlannerCfg planner;
  HandPlannerCfg hand;
  double fast = 0.20, slow = 0.08;              // m/s, of the tool on lines
  double pregrasp = 0.04;                       // m, behind the grasp along the approach
  double lift = 0.08;                           // m above the grasp
  double settle = 0.1, close_time = 0.5;        // s
  double preplace = 0.07;                       // m, above the place pose
  double clearance = 0.005;                     // m, between object and support at release
  double place_settle = 0.5, open_time = 0.25;  // s
  double retreat = 0.05;                        // m, opposite to the approach
  double rest = 0.5;                            // s, at the end
  // degrees from vertical; maximum tilt of the preferred approach, which is drawn at random
  double max_tilt = 90;
  int max_ik_candidates = 256;  // grasps tried before giving up
  // How many of them get a search far from the current joints, if there is no near solution.
  int max_far_candidates = 60;
  int max_paths = 6;  // how many of them get a path search
};

inline constexpr double kMargin = 0.004;       // m, clearance along paths
inline constexpr double kGraspMargin = 0.001;  // m, clearance of the open gripper at the grasp

class Manipulation {
 public:
  // Throws ValueError for a task without a GraspScene and for a robot without a hand.
  Manipulation(const episode::Task& task, const ManipulationPlannerCfg& cfg);

  const ManipulationPlannerCfg& cfg() const { return cfg_; }
  const robots::Robot& robot() const { return task_.robot(); }
  const episode::GraspScene& scene() const { return scene_; }
  int num_hands() const { return static_cast<int>(hands_.size()); }
  HandPlanner& hand(int hand) const { return *hands_[hand]; }
  const GripperShape& gripper(int hand) const { return grippers_[hand]; }
  const robots::MoveGroup& gripper_group(const HandPlanner& hand) const {
    return robot().groups()[hand.hand().gripper];
  }

  // The target object of this world.
  const episode::ObjectShape& target_shape(int world) const {
    return scene_.shape(world, scene_.target(world));
  }
  int target_body(int world) const { return scene_.all_objects()[scene_.target(world)].body; }
  Pose object_pose(const World& world) const;  // X_WO
  // Random numbers that depend only on the episode and the request, not on the world or on earlier
  // plans.
  Rng rng(const World& world, const PlanRequest& request, std::string_view what) const;

 private:
  const episode::Task& task_;
  const ManipulationPlannerCfg& cfg_;
  const episode::GraspScene& scene_;
  std::vector<std::unique_ptr<HandPlanner>> hands_;
  std::vector<GripperShape> grippers_;  // [hands]
};

}  // namespace mjsense::tasks::policies
