// SPDX-License-Identifier: Apache-2.0
#pragma once
// Moves a mobile base a short distance along a straight line, with a held object, to a pose from
// which a task is possible that is not possible from the current one.

#include <functional>
#include <optional>

#include "mjsense_tasks/policies/planner/collision.h"
#include "mjsense_tasks/policies/planner/plan_follower.h"
#include "mjsense_tasks/scenes/robot_floor.h"

namespace mjsense::tasks::policies {

class BaseReposition {
 public:
  struct Held {
    robots::Hand hand;
    int body = -1;     // has a free joint
    Pose tool_object;  // X_TO
  };

  BaseReposition(const mjModel* model,
                 const robots::Robot& robot);  // requires driving_base(robot) >= 0

  // Adds a segment that drives to the nearest base pose for which `works` returns true and whose
  // path is free of collisions. `works` receives a world with the base at that pose, in which only
  // positions are valid. Returns false and leaves the plan unchanged if there is none.
  bool plan(const World& world, int phase, const std::optional<Held>& held,
            const std::function<bool(const World& there)>& works, Plan& plan);

 private:
  const mjModel* model_;
  const robots::Robot& robot_;
  int group_;
  CollisionModel collisions_;
  worlds::ScratchData scratch_;
};

}  // namespace mjsense::tasks::policies
