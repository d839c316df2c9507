// SPDX-License-Identifier: Apache-2.0
#pragma once
// Plans how arm and base together grasp a handle, press it and move the door along its arc: the
// arm's joint positions and the base pose for every few degrees, all free of collisions.

#include <mujoco/mujoco.h>

#include <array>
#include <optional>
#include <vector>

#include "mjsense/worlds/scratch_data.h"
#include "mjsense_tasks/policies/door/door_handle_grasp.h"
#include "mjsense_tasks/policies/planner/plan_follower.h"
#include "mjsense_tasks/scenes/base_planner.h"

namespace mjsense::tasks::policies {

struct DoorMotionCfg {
  double before = 0.10;      // m, from the pregrasp to the handle
  double leaf_step = 0.07;   // rad, door rotation between two waypoints
  double press_step = 0.15;  // rad, lever rotation between two waypoints
  double margin = 0.03;   // m, clearance of the base from walls and leaf where it grasps the handle
  double depth = 0.0005;  // m, penetration that counts as a collision
};

struct DoorWaypoint {
  std::vector<double> q;  // arm joint positions
  scenes::BasePose base;
  double leaf = 0;  // rad, hinge rotation since the start
};

struct DoorMotion {
  robots::Hand hand;
  Pose grasp;                          // X_WT
  std::vector<DoorWaypoint> approach;  // pregrasp .. grasp
  std::vector<DoorWaypoint> press, open;
  std::vector<DoorWaypoint> leave;  // withdraw from the handle
  double cost = 0;
};

// The floor without the door leaf, and the footprint of the base.
struct DoorFloor {
  const scenes::OccupancyGrid* floor;
  const scenes::Footprint* footprint;
};

class DoorMotions {
 public:
  DoorMotions(const mjModel* model, const robots::Robot& robot, DoorFloor floor,
              DoorMotionCfg cfg = {});

  std::span<const robots::Hand> hands() const { return hands_; }
  // The motion that opens the door by `leaf` rad from its current angle, with the base at `base`
  // for the grasp and at least `margin` m away from walls and leaf afterwards. It is the cheapest
  // over the hands (`tool` >= 0: only this arm) and both grasps of the handle; the other arms are
  // tucked in. Empty if there is none.
  std::optional<DoorMotion> plan(const World& world, const scenes::Door& door,
                                 const scenes::BasePose& base, double leaf, double margin,
                                 int tool = -1) const;
  // Joint positions of an arm that is not used: all at 0, clipped to their ranges.
  std::vector<double> tucked(const robots::Hand& hand) const;
  // Base poses in front of the door from which to grasp the handle, the most promising first.
  std::vector<scenes::BasePose> places(const World& world, const scenes::Door& door) const;
  // Clearance (m) of a base at this pose from walls and from the leaf, with the leaf rotated by
  // `leaf` rad.
  double clearance(const DoorGeometry& geometry, const scenes::BasePose& base, double leaf) const;

 private:
  class Attempt;
  int base_group_;
  const mjModel* model_;
  const robots::Robot& robot_;
  DoorFloor floor_;
  DoorMotionCfg cfg_;
  std::vector<robots::Hand> hands_;
  mutable worlds::ScratchData scratch_;
};

}  // namespace mjsense::tasks::policies
