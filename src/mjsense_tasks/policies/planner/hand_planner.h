// SPDX-License-Identifier: Apache-2.0
#pragma once
// Motions of one hand: inverse kinematics, collision-free paths, and the plan segments for them. An
// arm moves its joints; a floating hand moves along screws.

#include <memory>
#include <optional>

#include "mjsense_tasks/policies/planner/collision.h"
#include "mjsense_tasks/policies/planner/joint_path.h"
#include "mjsense_tasks/policies/planner/plan_follower.h"

namespace mjsense::tasks::policies {

struct HandPlannerCfg {
  double joint_speed = 1.5, joint_acceleration = 4.0;  // rad/s, rad/s^2
  double slide_speed = 0.3, slide_acceleration = 1.0;  // m/s, m/s^2
  double tool_speed = 0.30;                            // m/s, on collision-free paths
  double turn_speed = 1.5;                             // rad/s, of the tool on lines
  double line_step = 0.02;                             // m between the checked poses of a line
};

// A pose of the hand: its tool pose and the joint positions for it.
struct HandPose {
  Pose tool;  // X_WT
  robots::RobotValues joints;
};

class HandPlanner {
 public:
  HandPlanner(const mjModel* model, const robots::Robot& robot, robots::Hand hand,
              HandPlannerCfg cfg = {});

  const robots::Hand& hand() const { return hand_; }
  bool floats() const { return hand_.floats(); }
  CollisionModel& collisions() { return *collisions_; }

  // The start of a plan: the commanded pose or, without a command, the measured one.
  HandPose now(const World& world, const Follower& follower) const;
  // Inverse kinematics for the tool at X_WT, starting from `near`. `iterations` above
  // Chain::kTracking also searches farther away.
  bool reach(const World& world, const Pose& tool, const HandPose& near, HandPose& out,
             int iterations = robots::Chain::kTracking) const;
  // Joint positions at the end of a screw from `from` to X_WT, without collision checks. They are
  // continuous with `from`; reach() could end in a contorted posture of a redundant arm.
  bool reach_along(const World& world, const Pose& tool, const HandPose& from, HandPose& out) const;
  bool is_free(CollisionQuery& query, const HandPose& at) const;
  // True if the tool can move along a screw without collision, ends excluded. `end` is the pose at
  // its end.
  bool line_is_free(const World& world, CollisionQuery& query, const HandPose& from, const Pose& to,
                    HandPose& end) const;

  // Adds the segment of a straight line.
  Segment& add_line(const World& world, Plan& plan, int phase, const Pose& from, const Pose& to,
                    double speed, double settle = 0) const;
  // Adds segments of a collision-free path between two poses. Returns false and leaves the plan
  // unchanged if none is found.
  bool add_path(const World& world, CollisionQuery& query, Plan& plan, int phase,
                const HandPose& from, const HandPose& to, Rng& rng) const;

 private:
  std::span<const double> joints(const HandPose& at) const { return at.joints[hand_.tool].view(); }
  Pose base_of(const Pose& tool) const { return tool * tool_base_; }

  const robots::Robot* robot_;
  robots::Hand hand_;
  HandPlannerCfg cfg_;
  JointSpace space_;
  Pose tool_base_;  // X_TB of a floating hand
  std::unique_ptr<CollisionModel> collisions_;
};

}  // namespace mjsense::tasks::policies
