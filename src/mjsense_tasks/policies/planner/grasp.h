// SPDX-License-Identifier: Apache-2.0
#pragma once
// Grasp candidates of a parallel gripper: from above, for an object on a support, or from any
// direction.
//
// Tool frame: z is the approach, y the closing direction, the origin lies between the finger tips.

#include <span>
#include <string>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense_tasks/episode/object_shape.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::policies {

// The open gripper: boxes in the tool frame.
struct GripperShape {
  struct Box {
    Pose pose;  // X_TB
    Vec3 half;  // m
  };
  std::vector<Box> boxes;
  Vec3 center;  // of a sphere that contains all boxes
  double radius = 0;
  double tip = 0;  // m, maximum reach of the fingers beyond the origin, at any opening
  double pad_half_width = 0, pad_half_length = 0;  // m, of a pad, across and along the approach
  // m, middle of the pads along the approach; negative (behind the origin) if the fingers end near
  // the origin.
  double pad_middle = 0;
  double max_opening = 0;  // m
  // Rotation from the robot's tool frame to the tool frame above; both have the same z axis. Not
  // the identity if the pads close along another axis than y.
  Quat turn;  // q_TG

  // From the colliding geoms of the gripper group at its start configuration.
  GripperShape(const mjModel* model, const robots::Robot& robot, int gripper);
  // Height (m) of the lowest corner of a box in the world.
  double lowest(const Pose& tool) const;
  // True if a point of the object is within `margin` of a box.
  bool hits(const Pose& tool, const Pose& object, const episode::ObjectShape& shape,
            double margin) const;
};

// A tool pose moved up by `height`, and one moved back against the approach by `distance`, m.
inline Pose raised(Pose pose, double height) {
  pose.p.z += height;
  return pose;
}
inline Pose backed(const Pose& pose, double distance) { return pose * Pose{{0, 0, -distance}, {}}; }

struct Grasp {
  Pose pose;         // X_WT
  double width = 0;  // m, between the pads
  double cost = 0;
};

// Candidates from above, sorted by cost = distance to the tool (m) + 0.01 * turn (deg) + 2 *
// approach_z + 8 * distance to the object's origin (m). Each closes on two opposite faces that are
// wide enough to resist rotation.
std::vector<Grasp> propose_grasps(const GripperShape& gripper, const episode::ObjectShape& shape,
                                  const Pose& object, double support_height, const Pose& tool);

// How many candidates of grasps_all_around() each check rejected.
struct GraspChecks {
  int candidates = 0;
  int nothing_between = 0;  // no point of the object, or less than 4 mm of it, is between the pads
  int too_wide = 0;         // for the gripper
  int no_faces = 0;         // that are opposite and wide enough
  int in_object = 0;        // the open gripper
};
// "0 grasps: of 900 candidates 700 too wide for the gripper, which opens to 85 mm; ...".
std::string text_of(const GraspChecks& checks, const GripperShape& gripper);

// Grasps of an object in its own frame, regardless of its support: closing directions over the
// whole sphere with sixteen approaches each, filtered by the same criterion for faces. The open
// gripper does not collide with the object. `cost` is 8 * distance to the object's origin (m) + 4 *
// slope of the faces (without the slope RB-Y1 retried 6 of 50 picks instead of 1).
std::vector<Grasp> grasps_all_around(const GripperShape& gripper, const episode::ObjectShape& shape,
                                     GraspChecks* checks = nullptr);

// The grasps of an object at X_WO in the world frame, sorted by cost = distance to the tool (m) +
// 0.01 * turn (deg) - 2 * (approach . wanted) + 8 * distance to the object's origin (m). With
// wanted = -z these are the costs of propose_grasps; another `wanted` prefers grasps with that
// approach.
std::vector<Grasp> rank_grasps(std::span<const Grasp> of_object, const Pose& object,
                               const Pose& tool, Vec3 wanted);

}  // namespace mjsense::tasks::policies
