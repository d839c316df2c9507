// SPDX-License-Identifier: Apache-2.0
#pragma once
// Grasps of a door handle, and the motion of the handle as the door opens.

#include <mujoco/mujoco.h>

#include <optional>

#include "mjsense/core/pose.h"
#include "mjsense_tasks/robots/robot.h"
#include "mjsense_tasks/scenes/doors.h"

namespace mjsense::tasks::policies {

// The geometry of a door in its current state, world frame, m.
struct DoorGeometry {
  Vec3 hinge, hinge_axis;  // a point on the hinge, and its axis (right-handed)
  Vec3 pivot, pivot_axis;  // of the lever; unused without a lever
  double angle = 0;        // rad, current hinge angle
  double press = 0;        // rad, planned rotation of the lever from its current angle; 0: no lever
  Vec3 away;               // horizontal unit vector from the leaf towards the robot
  Vec3 edge;               // free edge of the leaf, at the height of `hinge`

  // `from`: position of the robot.
  DoorGeometry(const mjModel* model, const mjData* data, const scenes::Door& door, Vec3 from);
  // The pose of something attached to the handle after the lever has rotated by `lever` and the
  // hinge by `leaf` rad.
  Pose carried(const Pose& pose, double lever, double leaf) const;
  Vec3 edge_at(double leaf) const;
};

// Two grasps that differ by half a turn about the approach. The tool's z axis is the approach; its
// closing direction follows from the pads. Empty if the handle has no bar on the robot's side.
struct HandleGrasps {
  Pose poses[2];  // X_WT
};
std::optional<HandleGrasps> handle_grasps(const mjModel* model, const mjData* data,
                                          const scenes::Door& door, const DoorGeometry& geometry,
                                          Vec3 closing_in_tool);

// Closing direction of a gripper's pads at its current state, tool frame.
Vec3 closing_direction(const mjData* data, const robots::MoveGroup& gripper);

}  // namespace mjsense::tasks::policies
