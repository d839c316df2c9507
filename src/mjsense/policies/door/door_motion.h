// SPDX-License-Identifier: Apache-2.0
#pragma once
// How arm and base together take a handle, press it and lead the door along its arc: the arm's joint
// positions and the base's place for every few degrees, none of them in collision.

#include <mujoco/mujoco.h>

#include <array>
#include <optional>
#include <vector>

#include "mjsense/policies/door/handle_grasp.h"
#include "mjsense/policies/planner/follower.h"
#include "mjsense/scenes/base_route.h"
#include "mjsense/worlds/scratch_data.h"

namespace mjsense {

struct DoorMotionCfg {
  double before = 0.10;      // m, of the pregrasp from the handle
  double leaf_step = 0.07;   // rad, of the door between two waypoints
  double press_step = 0.15;  // rad, of a lever
  double margin = 0.03;      // m, that the base keeps from walls and leaf where it takes the handle
  double depth = 0.0005;     // m, that counts as a collision
};

struct DoorWaypoint {
  std::vector<double> q;  // of the arm
  BasePose base;
  double leaf = 0;  // rad, of the hinge from where it began
};

struct DoorMotion {
  Hand hand;
  Pose grasp;                          // X_WT
  std::vector<DoorWaypoint> approach;  // pregrasp .. grasp
  std::vector<DoorWaypoint> press, open;
  std::vector<DoorWaypoint> leave;  // back off the handle
  double cost = 0;
};

// What a base may stand on while a door opens: the floor without the leaf.
struct DoorFloor {
  const Occupancy* floor;
  const Footprint* footprint;
};

class DoorMotions {
 public:
  DoorMotions(const mjModel* model, const Robot& robot, DoorFloor floor, DoorMotionCfg cfg = {});

  std::span<const Hand> hands() const { return hands_; }
  // With the base here at the grasp, the door led to `leaf` rad from where it stands, the base `margin`
  // m off walls and leaf on the way; the best of the hands (`tool` >= 0: of this arm) and of both
  // ways to take the handle, the other arms tucked in. Nothing where it cannot be done.
  std::optional<DoorMotion> plan(const World& world, const Door& door, const BasePose& base,
                                 double leaf, double margin, int tool = -1) const;
  // Joint positions of an arm that is not needed: all at 0, as far as their ranges go.
  std::vector<double> tucked(const Hand& hand) const;
  // Places before the door from which to take the handle, those first that are likely to do.
  std::vector<BasePose> places(const World& world, const Door& door) const;
  // Whether a base there keeps off walls and leaf, the leaf turned by so much.
  double clearance(const DoorGeometry& geometry, const BasePose& base, double leaf) const;

 private:
  class Attempt;
  int base_group_;
  const mjModel* model_;
  const Robot& robot_;
  DoorFloor floor_;
  DoorMotionCfg cfg_;
  std::vector<Hand> hands_;
  mutable ScratchData scratch_;
};

}  // namespace mjsense
