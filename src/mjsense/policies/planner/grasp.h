// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where a parallel gripper can take an object: from above, as it lies on a support, or from anywhere.
//
// Tool frame: z the approach, y the closing direction, the origin between the finger tips.

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/episode/object_shape.h"
#include "mjsense/robots/robot.h"

namespace mjsense {

// The open gripper: boxes in the tool frame.
struct GripperShape {
  struct Box {
    Pose pose;  // X_TB
    Vec3 half;  // m
  };
  std::vector<Box> boxes;
  Vec3 center;  // of a sphere around all boxes
  double radius = 0;
  double tip = 0;  // m, how far the fingers reach below the origin, at any opening
  double pad_half_width = 0, pad_half_length = 0;  // m, of a pad, across and along the approach
  double pad_middle =
      0;  // m, of the pads along the approach: behind the origin where that is near their ends
  double max_opening = 0;  // m
  // The frame above in the robot's tool frame, whose z it has: another where pads close along another axis than y.
  Quat turn;  // q_TG

  // From the gripper group's geoms that touch, at its start configuration.
  GripperShape(const mjModel* model, const Robot& robot, int gripper);
  // Height (m) of the lowest corner of a box in the world.
  double lowest(const Pose& tool) const;
  // True if one of the points lies within `margin` of a box.
  bool hits(const Pose& tool, const Pose& object, const ObjectShape& shape, double margin) const;
};

struct Grasp {
  Pose pose;         // X_WT
  double width = 0;  // m, between the pads
  double cost = 0;
};

// Candidates by rising cost = distance to the tool (m) + 0.01 * turn (deg) + 2 * approach_z + 8 *
// distance to the object's origin (m). Each closes on two faces that stand opposite and are wide
// enough to hold against turning.
std::vector<Grasp> propose_grasps(const GripperShape& gripper, const ObjectShape& shape,
                                  const Pose& object, double support_height, const Pose& tool);

// Grasps of an object in its own frame, whatever it stands on: closing directions all over the
// sphere, sixteen approaches about each; chosen by the same faces. The open gripper touches the object in none.
// `cost` is 8 * distance to the object's origin (m) + 4 * slope of the faces (without it RB-Y1 began 6 of
// 50 picks again instead of 1).
std::vector<Grasp> grasps_all_around(const GripperShape& gripper, const ObjectShape& shape);

// The grasps of an object at X_WO in the world, by rising cost = distance to the tool (m) + 0.01 * turn (deg) - 2
// * (approach . wanted) + 8 * distance to the object's origin (m). With wanted = -z these are the costs of
// propose_grasps; another direction asks for grasps from there.
std::vector<Grasp> rank_grasps(std::span<const Grasp> of_object, const Pose& object,
                               const Pose& tool, Vec3 wanted);

}  // namespace mjsense
