// SPDX-License-Identifier: Apache-2.0
#pragma once
// Plans a placement: puts the held object where the task's PlaceScene says, releases it and
// retreats.

#include "mjsense_tasks/policies/planner/manipulation.h"
#include "mjsense_tasks/policies/planner/rejections.h"

namespace mjsense::tasks::policies {

class Placing {
 public:
  // Final pose of a hand, used if a collision-free path exists: joint positions of an arm, X_WT of
  // a floating hand.
  struct Home {
    robots::RobotValues joints;
    Pose tool;
  };

  explicit Placing(const Manipulation& shared) : m_(shared) {}

  // True if a hand that grasps the object at `at`, at its current pose, can reach the place;
  // inverse kinematics only.
  bool reaches(const World& world, const HandPlanner& hand, const HandPose& at) const;
  // Plans from the current state, with the object at X_TO in the hand. Returns false and leaves the
  // plan unchanged if there is no path.
  bool plan(const World& world, const PlanRequest& request, const Follower& follower,
            HandPlanner& hand, const Pose& tool_object, const Home& home, Plan& plan) const;
  // Lowers the object straight down to its support and releases it, if the place cannot be reached.
  // Returns false and leaves the plan unchanged if something is in between.
  bool put_back(const World& world, const Follower& follower, HandPlanner& hand,
                const Pose& tool_object, Plan& plan) const;

 private:
  // X_WO of the object at a place, with the k-th turn from its orientation in the hand.
  Pose placed(const Pose& object, const episode::ObjectShape& shape, Vec3 place, int k) const;
  // Height (m) of the object's lowest point above its origin, at orientation `object`.
  double underside(const episode::ObjectShape& shape, const Quat& object) const;
  // True if the open hand can retreat from the object released at X_WO; `away` is the pose after
  // that.
  bool retreat_is_free(const World& world, HandPlanner& hand, const HandPose& at,
                       const Pose& object, HandPose& away) const;
  bool place_at(const World& world, HandPlanner& hand, CollisionQuery& query, const HandPose& start,
                const Pose& object, const Pose& tool_object, const Home& home, Rng& rng, Plan& plan,
                Rejection& rejection) const;
  void plan_return_home(const World& world, HandPlanner& hand, const HandPose& from,
                        const Pose& object, const Home& home, Rng& rng, Plan& plan) const;

  const Manipulation& m_;
};

}  // namespace mjsense::tasks::policies
