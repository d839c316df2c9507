// SPDX-License-Identifier: Apache-2.0
#pragma once
// Detection of articulated furniture in a model: drawers and the doors of cabinets, microwaves and
// fridges. An articulation is a limited hinge or slide joint whose body has a graspable handle.

#include <mujoco/mujoco.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense::tasks {

// A bar or knob that a gripper can grasp, in the frame of the joint's body.
struct Handle {
  int geom = -1;
  Vec3 middle;
  Vec3 direction;                            // unit vector along the longest extent
  double half_length = 0;                    // m
  Vec3 outward;                              // unit vector away from the front that it is fixed to
  double half_across = 0, half_outward = 0;  // m, perpendicular to both axes; along `outward`
};

struct Articulation {
  int joint = -1, body = -1, qpos = -1, dof = -1;
  bool slide = false;
  double low = 0, high = 0;  // range: rad or m
  // Joint positions at the ends of the range; `closed` is the end nearer to 0.
  double closed = 0, open = 0;
  std::string name;      // full name of its body
  std::string category;  // kind of furniture, such as "drawer"
  std::string text;      // name for task descriptions
  Handle handle;

  double range() const { return high - low; }
  // Opening fraction |q| / range.
  double fraction(double q) const { return (q < 0 ? -q : q) / range(); }
  // The joint position with this opening fraction, between closed and open.
  double at(double fraction) const;
  // Motion of the body in the world frame when the joint moves from one position to another. `axis`
  // and `anchor` are the joint's, in the world frame.
  Pose motion(double from, double to, Vec3 axis, Vec3 anchor) const;
};

// In the order of the model's joints. Joints with actuators are skipped, and joints of bodies whose
// names start with `robot_prefix` (unless it is empty).
std::vector<Articulation> find_articulations(const mjModel* model, std::string_view robot_prefix);

}  // namespace mjsense::tasks
