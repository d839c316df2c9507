// SPDX-License-Identifier: Apache-2.0
#pragma once
// Plans a pick: grasps the target object with one of the hands, from any direction, and lifts it.

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "mjsense_tasks/policies/planner/failed_grasps.h"
#include "mjsense_tasks/policies/planner/manipulation.h"
#include "mjsense_tasks/policies/planner/placing.h"

namespace mjsense::tasks::policies {

class Picking {
 public:
  struct Grip {
    int hand = 0;
    Pose tool_object;  // X_TO in the hand
    Pose start;        // X_WT of the hand at the start of the plan
  };

  // `placing`: if not null, a hand is preferred that can also reach the place; null: no placing.
  Picking(const Manipulation& shared, const Placing* placing);

  // Adds segments from the current state until the object is lifted. Returns nothing and adds no
  // segments if no plan is found.
  std::optional<Grip> plan(const World& world, const PlanRequest& request, const Follower& follower,
                           const FailedGrasps& failed, Plan& plan);
  // True if one of the best grasps is possible from the current state; a short search.
  bool can(const World& world, const PlanRequest& request, const Follower& follower,
           const FailedGrasps& failed);
  // Adds segments that move the arms to the joint positions of `home` as far as collision-free
  // paths exist. From other positions the arms may be unable to reach the object or may block each
  // other.
  void plan_return_home(const World& world, const PlanRequest& request, const Follower& follower,
                        const robots::RobotValues& home, Plan& plan) const;

 private:
  struct Search;
  // With `to_place`, accepts only grasps from which the place is reachable.
  std::optional<Grip> plan_pick_with(const Search& search, int hand, bool to_place, Plan& plan);
  // The preferred approach of an episode, drawn at random: from vertical to nearly horizontal,
  // pointing away from the robot.
  Vec3 wanted_approach(const World& world, const PlanRequest& request, const Pose& object) const;
  HandPose draw_back(const World& world, HandPlanner& hand, CollisionQuery& query,
                     const HandPose& start, Plan& plan) const;
  bool lift(const World& world, HandPlanner& hand, const HandPose& at, Plan& plan) const;
  struct Grasps {
    std::once_flag once;
    std::vector<Grasp> of_object;
    GraspChecks checks;
  };
  const Grasps& grasps(const episode::ObjectShape& shape, int hand);

  const Manipulation& m_;
  const Placing* placing_;
  // By address of the shape and hand; computed on first use.
  std::map<std::pair<const episode::ObjectShape*, int>, Grasps> grasps_;
  std::mutex grasps_mutex_;  // guards the map, not its values
};

}  // namespace mjsense::tasks::policies
