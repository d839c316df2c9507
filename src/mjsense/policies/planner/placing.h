// SPDX-License-Identifier: Apache-2.0
#pragma once
// Puts down what a hand holds, where the task's PlaceScene says, lets it go and draws back.

#include "mjsense/policies/planner/manipulation.h"
#include "mjsense/policies/planner/refusals.h"

namespace mjsense {

class Placing {
 public:
  // Where a hand goes in the end, if there is a free way: joints of arms, X_WT of one that floats.
  struct Home {
    RobotValues joints;
    Pose tool;
  };

  explicit Placing(const Manipulation& shared) : m_(shared) {}

  // A hand that took the object at `at`, as it lies, could put it down so: inverse kinematics alone.
  bool reaches(const World& world, const HandPlanner& hand, const HandPose& at) const;
  // From where the hand is, with the object at X_TO in it. False, and the plan as it was, if there is no way.
  bool plan(const World& world, const PlanRequest& request, const Follower& follower,
            HandPlanner& hand, const Pose& tool_object, const Home& home, Plan& plan) const;
  // Straight down to what it was taken from, and lets it go, where there is no way to the place. False, and the plan
  // as it was, if there is something in between.
  bool put_back(const World& world, const Follower& follower, HandPlanner& hand,
                const Pose& tool_object, Plan& plan) const;

 private:
  // X_WO of the object at a place, turned the k-th way from how it hangs at X_WO.
  Pose placed(const Pose& object, const ObjectShape& shape, Vec3 place, int k) const;
  // Height (m) of its lowest point above its origin, as it hangs.
  double underside(const ObjectShape& shape, const Quat& object) const;
  // Where the open hand gets away from the object that it has let go at X_WO.
  bool gets_away(const World& world, HandPlanner& hand, const HandPose& at, const Pose& object,
                 HandPose& away) const;
  bool place_at(const World& world, HandPlanner& hand, CollisionQuery& query, const HandPose& start,
                const Pose& object, const Pose& tool_object, const Home& home, Rng& rng, Plan& plan,
                Refusal& refusal) const;
  void go_home(const World& world, HandPlanner& hand, const HandPose& from, const Pose& object,
               const Home& home, Rng& rng, Plan& plan) const;

  const Manipulation& m_;
};

}  // namespace mjsense
