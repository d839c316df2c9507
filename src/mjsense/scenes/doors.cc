// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/doors.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scenes {
namespace {

constexpr double kMinWidth = 0.4;        // m
constexpr double kBothDirections = 0.2;  // rad, minimum range in both directions of a swing door

struct Extent {
  std::array<double, 3> low{1e10, 1e10, 1e10}, high{-1e10, -1e10, -1e10};
};

// Bounding box of the geoms of a body, in the body frame.
Extent extent_of(const mjModel* m, int body) {
  Extent extent;
  for (int g = m->body_geomadr[body]; g < m->body_geomadr[body] + m->body_geomnum[body]; ++g) {
    const Pose pose{vec3(m->geom_pos + 3 * g), quat(m->geom_quat + 4 * g)};
    const double* box = m->geom_aabb + 6 * g;
    for (int corner = 0; corner < 8; ++corner) {
      Vec3 p{box[0] + (corner & 1 ? box[3] : -box[3]), box[1] + (corner & 2 ? box[4] : -box[4]),
             box[2] + (corner & 4 ? box[5] : -box[5])};
      p = pose * p;
      for (int i = 0; i < 3; ++i) {
        extent.low[i] = std::min(extent.low[i], p[i]);
        extent.high[i] = std::max(extent.high[i], p[i]);
      }
    }
  }
  return extent;
}

// Pose of a body with all joints at their reference positions.
Pose rest_pose(const mjModel* m, int body) {
  Pose pose{vec3(m->body_pos + 3 * body), quat(m->body_quat + 4 * body)};
  while ((body = m->body_parentid[body]) > 0)
    pose = Pose{vec3(m->body_pos + 3 * body), quat(m->body_quat + 4 * body)} * pose;
  return pose;
}

bool is_leaf(const mjModel* m, int body, int joint) {
  if (m->jnt_type[joint] != mjJNT_HINGE || !m->jnt_limited[joint] || m->body_geomnum[body] == 0)
    return false;
  const Pose rest = rest_pose(m, body);
  const Vec3 axis = vec3(m->jnt_axis + 3 * joint);
  if (std::abs(rotate(rest.q, axis).z) < 0.906) return false;
  const Extent extent = extent_of(m, body);
  double size[3];
  for (int i = 0; i < 3; ++i) size[i] = extent.high[i] - extent.low[i];
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
  const Extent extent = extent_of(m, door.body);
  const Vec3 middle{0.5 * (extent.low[0] + extent.high[0]), 0.5 * (extent.low[1] + extent.high[1]),
                    0.5 * (extent.low[2] + extent.high[2])};
  return pose_from_mat(d->xpos + 3 * door.body, d->xmat + 9 * door.body) * middle;
}

Vec3 opening_direction(const mjModel* m, const mjData* d, const Door& door) {
  const Vec3 axis = vec3(d->xaxis + 3 * door.joint), anchor = vec3(d->xanchor + 3 * door.joint);
  Vec3 direction = cross(axis, leaf_middle(m, d, door) - anchor);
  if (door.open < door.shut) direction = -direction;
  direction.z = 0;
  return normalized(direction);
}

}  // namespace mjsense::scenes
