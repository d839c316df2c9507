// SPDX-License-Identifier: Apache-2.0
#pragma once
// Moves a base that drives a little, straight, with what a hand holds, to where something can be done that cannot be
// done from here.

#include <functional>
#include <optional>

#include "mjsense/policies/planner/collision.h"
#include "mjsense/policies/planner/follower.h"
#include "mjsense/scenes/robot_floor.h"

namespace mjsense {

class BaseShift {
 public:
  struct Held {
    Hand hand;
    int body = -1;     // with a free joint
    Pose tool_object;  // X_TO
  };

  BaseShift(const mjModel* model, const Robot& robot);  // driving_base(robot) >= 0

  // Adds a segment that drives to the nearest place for which `works` - it sees the world as if the base stood there,
  // positions alone - and on the way to which nothing is touched. False, and the plan as it was, if there is none.
  bool plan(const World& world, int phase, const std::optional<Held>& held,
            const std::function<bool(const World& there)>& works, Plan& plan);

 private:
  const mjModel* model_;
  const Robot& robot_;
  int group_;
  CollisionModel collisions_;
  ScratchData scratch_;
};

}  // namespace mjsense
