// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/doors.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr double kMinWidth = 0.4;        // m
constexpr double kBothDirections = 0.2;  // rad, minimum range in both directions of a swing door

// Bounding box of the geoms of a body, in the body frame.
Aabb extent_of(const mjModel* m, int body) {
  Aabb extent;
  for (int g = m->body_geomadr[body]; g < m->body_geomadr[body] + m->body_geomnum[body]; ++g) {
    for (Vec3 corner : geom_corners(m, g)) extent.add(geom_frame(m, g) * corner);
  }
  return extent;
}

bool is_leaf(const mjModel* m, int body, int joint) {
  if (m->jnt_type[joint] != mjJNT_HINGE || !m->jnt_limited[joint] || m->body_geomnum[body] == 0)
    return false;
  const Pose rest = in_ancestor(m, body_frame(m, body), m->body_parentid[body]);
  const Vec3 axis = vec3(m->jnt_axis + 3 * joint);
  if (std::abs(rotate(rest.q, axis).z) < 0.906) return false;
  const Vec3 size = extent_of(m, body).size();
  // The height of the leaf is along the hinge axis; its width is the larger of the other two
  // extents.
  int up = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::abs(axis[i]) > std::abs(axis[up])) up = i;
  }
  const double width = std::max(size[(up + 1) % 3], size[(up + 2) % 3]);
  return size[up] >= Door::kMinHeight && width >= kMinWidth;
}

bool called_handle(std::string name) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
  name = name.substr(name.rfind('/') + 1);
  for (const char* word : {"handle", "lever", "knob"}) {
    if (name.find(word) != std::string::npos) return true;
  }
  return false;
}

int hinge_of(const mjModel* m, int body) {
  const int joint = m->body_jntadr[body];
  return m->body_jntnum[body] == 1 && m->jnt_type[joint] == mjJNT_HINGE ? joint : -1;
}

void find_handle(const mjModel* m, Door& door) {
  door.handle = door.body;
  for (const bool by_name : {true, false}) {
    for (int body = door.body + 1; body < m->nbody; ++body) {
      if (!observe::is_descendant_or_self(m, body, door.body)) continue;
      const int hinge = hinge_of(m, body);
      if (by_name ? !called_handle(scene::name_of(m, mjOBJ_BODY, body)) : hinge < 0) continue;
      door.handle = body;
      door.handle_joint = hinge;
      return;
    }
  }
}

}  // namespace

double Door::fraction(double position) const {
  double part = (position - shut) / (open - shut);
  if (swings) part = std::abs(part);
  return std::clamp(part, 0.0, 1.0);
}

std::vector<Door> find_doors(const mjModel* m, std::string_view robot_prefix) {
  std::vector<Door> doors;
  for (int body = 1; body < m->nbody; ++body) {
    if (m->body_jntnum[body] != 1) continue;
    if (!robot_prefix.empty() && scene::name_of(m, mjOBJ_BODY, body).starts_with(robot_prefix))
      continue;
    const int joint = m->body_jntadr[body];
    if (!is_leaf(m, body, joint)) continue;
    Door door{.joint = joint, .body = body};
    const double low = m->jnt_range[2 * joint], high = m->jnt_range[2 * joint + 1];
    // Shut is the model's reference position: 0, or the nearest end of the range.
    door.shut = std::clamp(0.0, low, high);
    door.open = high - door.shut >= door.shut - low ? high : low;
    door.swings = low < -kBothDirections && high > kBothDirections;
    find_handle(m, door);
    doors.push_back(door);
  }
  return doors;
}

Vec3 leaf_middle(const mjModel* m, const mjData* d, const Door& door) {
  const Vec3 middle = extent_of(m, door.body).center();
  return pose_from_mat(d->xpos + 3 * door.body, d->xmat + 9 * door.body) * middle;
}

Vec3 opening_direction(const mjModel* m, const mjData* d, const Door& door) {
  const Vec3 axis = vec3(d->xaxis + 3 * door.joint), anchor = vec3(d->xanchor + 3 * door.joint);
  Vec3 direction = cross(axis, leaf_middle(m, d, door) - anchor);
  if (door.open < door.shut) direction = -direction;
  direction.z = 0;
  return normalized(direction);
}

}  // namespace mjsense::tasks::scenes
