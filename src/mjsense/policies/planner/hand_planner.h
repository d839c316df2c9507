// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where a hand can go, and how: inverse kinematics, free ways, and the segments for them. An arm moves its own
// joints; a floating hand goes on screws.

#include <memory>
#include <optional>

#include "mjsense/policies/planner/collision.h"
#include "mjsense/policies/planner/follower.h"
#include "mjsense/policies/planner/motion.h"

namespace mjsense {

struct HandPlannerCfg {
  double joint_speed = 1.5, joint_acceleration = 4.0;  // rad/s, rad/s^2
  double slide_speed = 0.3, slide_acceleration = 1.0;  // m/s, m/s^2
  double tool_speed = 0.30;                            // m/s, on free ways
  double turn_speed = 1.5;                             // rad/s, of tools on lines
  double line_step = 0.02;  // m between places of a line that are looked at
};

// The hand somewhere: its tool, and the joints that put it there.
struct HandPose {
  Pose tool;  // X_WT
  RobotValues joints;
};

class HandPlanner {
 public:
  HandPlanner(const mjModel* model, const Robot& robot, Hand hand, HandPlannerCfg cfg = {});

  const Hand& hand() const { return hand_; }
  bool floats() const { return hand_.tool == hand_.gripper; }
  CollisionModel& collisions() { return *collisions_; }

  // Where a plan begins: as commanded, or as it stands.
  HandPose now(const World& world, const Follower& follower) const;
  // The tool at X_WT, from joints near those of `near`; `iterations` above Chain::kTracking also looks farther away.
  bool reach(const World& world, const Pose& tool, const HandPose& near, HandPose& out,
             int iterations = Chain::kTracking) const;
  // The joints at the end of a screw from `from` to X_WT, whatever is in the way: where reach() leaps, an
  // arm with more joints than it needs may end up in a knot.
  bool reach_along(const World& world, const Pose& tool, const HandPose& from, HandPose& out) const;
  bool is_free(CollisionQuery& query, const HandPose& at) const;
  // Whether the tool can go straight (on a screw) and touches nothing, ends excluded; `end` is where it arrives.
  bool line_is_free(const World& world, CollisionQuery& query, const HandPose& from, const Pose& to,
                    HandPose& end) const;

  // Adds the segment of a straight line.
  Segment& add_line(const World& world, Plan& plan, int phase, const Pose& from, const Pose& to,
                    double speed, double settle = 0) const;
  // Adds segments of a free way between two poses; false, and the plan as it was, if none is found.
  bool add_way(const World& world, CollisionQuery& query, Plan& plan, int phase,
               const HandPose& from, const HandPose& to, Rng& rng) const;

 private:
  std::span<const double> joints(const HandPose& at) const { return at.joints[hand_.tool].view(); }
  Pose base_of(const Pose& tool) const { return tool * tool_base_; }

  const Robot* robot_;
  Hand hand_;
  HandPlannerCfg cfg_;
  JointSpace space_;
  Pose tool_base_;  // X_TB of a floating hand
  std::unique_ptr<CollisionModel> collisions_;
};

}  // namespace mjsense
