// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/door/door_handle_grasp.h"

#include <algorithm>
#include <cmath>

#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"

namespace mjsense::tasks::policies {
namespace {

constexpr double kPressed = 0.86;  // fraction of the lever's range
// m, of the tool's origin behind the bar: when the hand pulls, it may slip a little
constexpr double kDeep = 0.018;
// grasp point, as a fraction of half the bar's length from its middle to its end
constexpr double kOut = 0.35;

Pose turned_about(Vec3 point, Vec3 axis, double angle) {
  const Quat q = axis_angle(axis, angle);
  return {point - rotate(q, point), q};
}

struct Bar {
  Vec3 center, along;  // along: unit vector
  double half = 0;
};

Bar bar_of(const mjModel* m, const mjData* d, int g) {
  const Pose pose = geom_pose(d, g);
  const double* box = m->geom_aabb + 6 * g;
  int longest = 0;
  for (int i = 1; i < 3; ++i) {
    if (box[3 + i] > box[3 + longest]) longest = i;
  }
  const Vec3 axis{longest == 0 ? 1.0 : 0.0, longest == 1 ? 1.0 : 0.0, longest == 2 ? 1.0 : 0.0};
  return {pose * vec3(box), rotate(pose.q, axis), box[3 + longest]};
}

}  // namespace

DoorGeometry::DoorGeometry(const mjModel* m, const mjData* d, const scenes::Door& door, Vec3 from) {
  hinge = vec3(d->xanchor + 3 * door.joint);
  hinge_axis = vec3(d->xaxis + 3 * door.joint);
  angle = d->qpos[m->jnt_qposadr[door.joint]];
  const Vec3 middle = scenes::leaf_middle(m, d, door),
             direction = scenes::opening_direction(m, d, door);
  away = dot(from - middle, direction) > 0 ? direction : -direction;
  edge = hinge + 2.0 * Vec3{middle.x - hinge.x, middle.y - hinge.y, 0};
  if (door.handle_joint < 0) return;
  const int j = door.handle_joint;
  pivot = vec3(d->xanchor + 3 * j);
  pivot_axis = vec3(d->xaxis + 3 * j);
  const double now = d->qpos[m->jnt_qposadr[j]];
  if (!m->jnt_limited[j]) return;
  const double low = m->jnt_range[2 * j], high = m->jnt_range[2 * j + 1];
  // From its rest position towards the more distant end of its range.
  const double rest = std::clamp(m->qpos0[m->jnt_qposadr[j]], low, high);
  const double end = high - rest >= rest - low ? high : low;
  press = rest + kPressed * (end - rest) - now;
}

Pose DoorGeometry::carried(const Pose& pose, double lever, double leaf) const {
  const Pose pressed = press != 0 ? turned_about(pivot, pivot_axis, lever) * pose : pose;
  return turned_about(hinge, hinge_axis, leaf) * pressed;
}

Vec3 DoorGeometry::edge_at(double leaf) const {
  return turned_about(hinge, hinge_axis, leaf) * edge;
}

std::optional<HandleGrasps> handle_grasps(const mjModel* m, const mjData* d,
                                          const scenes::Door& door, const DoorGeometry& geometry,
                                          Vec3 closing_in_tool) {
  const Vec3 middle = scenes::leaf_middle(m, d, door);
  Bar best;
  double longest = 0.02;
  for (int g = 0; g < m->ngeom; ++g) {
    if (!observe::is_descendant_or_self(m, m->geom_bodyid[g], door.handle) || !is_solid(m, g))
      continue;
    if (door.handle == door.body && m->geom_rbound[g] > 0.3) continue;  // this geom is the leaf
    const Bar bar = bar_of(m, d, g);
    if (dot(bar.center - middle, geometry.away) < 0.01) continue;
    const double length =
        bar.half * norm(bar.along - dot(bar.along, geometry.away) * geometry.away);
    if (length <= longest) continue;
    longest = length;
    best = bar;
  }
  if (best.half == 0) return {};
  Vec3 out = best.along;
  if (door.handle_joint >= 0 && dot(out, best.center - geometry.pivot) < 0) out = -out;
  const Vec3 approach = -geometry.away;
  const Vec3 at =
      best.center + (door.handle_joint >= 0 ? kOut * best.half : 0.0) * out + kDeep * approach;
  const Vec3 bar = normalized(out - dot(out, approach) * approach),
             closing = normalized(cross(approach, bar));
  // Rotation from (across, closing, approach) to the tool frame; below the same axes in the world.
  const Vec3 z{0, 0, 1}, c = normalized(closing_in_tool - dot(closing_in_tool, z) * z);
  const Quat tool = quat_from_columns(cross(c, z), c, z);
  HandleGrasps grasps;
  for (int i = 0; i < 2; ++i) {
    const Vec3 y = i == 0 ? closing : -closing;
    grasps.poses[i] = {
        at, normalized(quat_from_columns(cross(y, approach), y, approach) * conjugate(tool))};
  }
  return grasps;
}

Vec3 closing_direction(const mjData* d, const robots::MoveGroup& gripper) {
  const Vec3 a = vec3(d->site_xpos + 3 * gripper.pad_sites[0]),
             b = vec3(d->site_xpos + 3 * gripper.pad_sites[1]);
  const Pose tool = site_pose(d, gripper.leaf_site);
  return rotate(conjugate(tool.q), normalized(a - b));
}

}  // namespace mjsense::tasks::policies
