// SPDX-License-Identifier: Apache-2.0
#pragma once
// How a hand takes the handle of a door, and where the handle takes the hand.

#include <mujoco/mujoco.h>

#include <optional>

#include "mjsense/core/pose.h"
#include "mjsense/robots/robot.h"
#include "mjsense/scenes/doors.h"

namespace mjsense {

// A door as it stands, its axes in the world.
struct DoorGeometry {
  Vec3 hinge, hinge_axis;  // a point of it, and the direction about which positive angles turn
  Vec3 pivot, pivot_axis;  // of the lever; unused without one
  double angle = 0;        // rad, of the hinge now
  double press = 0;        // rad, by which the lever is to be turned from where it is; 0: no lever
  Vec3 away;               // horizontal, from the leaf to the robot
  Vec3 edge;               // of the leaf, far from the hinge, at the height of the hinge's point

  // `from`: where the robot stands.
  DoorGeometry(const mjModel* model, const mjData* data, const Door& door, Vec3 from);
  // What is carried along when the lever has been turned by `lever` and the hinge by `leaf` rad.
  Pose carried(const Pose& pose, double lever, double leaf) const;
  Vec3 edge_at(double leaf) const;
};

// Two ways, one the other turned about the approach by half a turn; the tool's z axis is the
// approach, its closing direction is found from its pads. Nothing where the handle has no bar on the
// robot's side.
struct HandleGrasps {
  Pose poses[2];  // X_WT
};
std::optional<HandleGrasps> handle_grasps(const mjModel* model, const mjData* data,
                                          const Door& door, const DoorGeometry& geometry,
                                          Vec3 closing_in_tool);

// Direction in which the pads of a gripper close, in its tool frame, as it stands.
Vec3 closing_direction(const mjData* data, const MoveGroup& gripper);

}  // namespace mjsense
