// SPDX-License-Identifier: Apache-2.0
#pragma once
// Takes the object of an episode with one of the hands, from any direction, and lifts it.

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "mjsense/policies/planner/failed_grasps.h"
#include "mjsense/policies/planner/manipulation.h"
#include "mjsense/policies/planner/placing.h"

namespace mjsense {

class Picking {
 public:
  struct Grip {
    int hand = 0;
    Pose tool_object;  // X_TO in the hand
    Pose start;        // X_WT of the hand where the plan begins
  };

  // `placing`: of several hands one is preferred that also gets to the place; null: nothing is placed.
  Picking(const Manipulation& shared, const Placing* placing);

  // Adds segments from where the hands are until the object is lifted. Nothing, and no segments, if there is no way.
  std::optional<Grip> plan(const World& world, const PlanRequest& request, const Follower& follower,
                           const FailedGrasps& failed, Plan& plan);
  // Whether it could take one of the best grasps from where it is, without a long search.
  bool can(const World& world, const PlanRequest& request, const Follower& follower,
           const FailedGrasps& failed);
  // Adds segments that bring the arms to the joints of `home`, as far as there are free ways: from elsewhere they may
  // reach nothing, or be in each other's way.
  void go_home(const World& world, const PlanRequest& request, const Follower& follower,
               const RobotValues& home, Plan& plan) const;

 private:
  struct Search;
  // With `to_place` only a grasp with which the object also gets to where it is wanted.
  std::optional<Grip> pick_with(const Search& search, int hand, bool to_place, Plan& plan);
  // The approach that an episode asks for: anything from above to nearly level, out of the way of the robot.
  Vec3 wanted_approach(const World& world, const PlanRequest& request, const Pose& object) const;
  HandPose draw_back(const World& world, HandPlanner& hand, CollisionQuery& query,
                     const HandPose& start, Plan& plan) const;
  bool lift(const World& world, HandPlanner& hand, const HandPose& at, Plan& plan) const;
  std::span<const Grasp> grasps(const ObjectShape& shape, int hand);

  const Manipulation& m_;
  const Placing* placing_;
  struct Grasps {
    std::once_flag once;
    std::vector<Grasp> of_object;
  };
  // Of shapes, by their addresses, and hands; made when they are needed.
  std::map<std::pair<const ObjectShape*, int>, Grasps> grasps_;
  std::mutex grasps_mutex_;  // of the map, not of what is in it
};

}  // namespace mjsense
