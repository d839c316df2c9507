// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/opening/articulation.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks {
namespace {

constexpr double kMinTravel = 0.05,
                 kMinSwing = 0.3;   // m, rad: smaller ranges are buttons or knobs
constexpr double kMinLever = 0.08;  // m, minimum distance of the handle from the hinge
constexpr double kThick = 0.062;    // m, maximum thickness that a gripper can enclose
constexpr double kMinLength = 0.012, kMaxLength = 0.8;  // m, length of a handle
constexpr double kProtrusion = 0.0008;  // m, minimum protrusion beyond all other parts

// Words in body names and their categories.
constexpr std::array<std::pair<std::string_view, std::string_view>, 14> kWordsOfThings{
    {{"drawer", "drawer"},
     {"microwave", "microwave"},
     {"micro", "microwave"},
     {"freezer", "freezer"},
     {"fridge", "fridge"},
     {"refrigerator", "fridge"},
     {"oven", "oven"},
     {"dishwasher", "dishwasher"},
     {"cabinet", "cabinet"},
     {"cupboard", "cabinet"},
     {"wardrobe", "wardrobe"},
     {"window", "window"},
     {"box", "box"},
     {"door", "door"}}};

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

// A geom that moves with the joint, as a box in the frame of the joint's body.
struct Part {
  int geom;
  Pose pose;  // pose of the box
  Vec3 half;
  bool named;  // its name contains "handle" or "knob"
  Aabb box;    // bounding box along the body's axes
};

// Pose of `body` in the frame of `root`; nullopt if there is a joint between them.
std::optional<Pose> rigid_pose(const mjModel* m, int body, int root) {
  Pose pose;
  for (; body != root; body = m->body_parentid[body]) {
    if (m->body_jntnum[body] > 0) return {};
    pose = body_frame(m, body) * pose;
  }
  return pose;
}

std::vector<Part> parts_of(const mjModel* m, int root) {
  std::vector<Part> parts;
  for (int g = 0; g < m->ngeom; ++g) {
    if (!is_solid(m, g)) continue;
    const int body = m->geom_bodyid[g];
    if (!observe::is_descendant_or_self(m, body, root)) continue;
    const std::optional<Pose> pose = rigid_pose(m, body, root);
    if (!pose) continue;
    const double* aabb = m->geom_aabb + 6 * g;
    Part part{g, *pose * geom_frame(m, g) * Pose{vec3(aabb), {}}, vec3(aabb + 3), false, {}};
    const std::string name = lower(scene::name_of(m, mjOBJ_GEOM, g) + " " +
                                   (body == root ? "" : scene::name_of(m, mjOBJ_BODY, body)));
    part.named = name.find("handle") != name.npos || name.find("knob") != name.npos;
    for (Vec3 corner : box_corners({}, part.half)) part.box.add(part.pose * corner);
    parts.push_back(part);
  }
  return parts;
}

Vec3 axis_of(const Pose& pose, int i) {
  return rotate(pose.q, {i == 0 ? 1.0 : 0, i == 1 ? 1.0 : 0, i == 2 ? 1.0 : 0});
}

// Half the extent of a part along a unit vector.
double half_length(const Part& part, Vec3 direction) {
  double sum = 0;
  for (int i = 0; i < 3; ++i) sum += std::abs(dot(direction, axis_of(part.pose, i))) * part.half[i];
  return sum;
}

// Whether the two shorter extents fit into a gripper; `longest` is set to the axis of the longest.
bool is_bar(const Part& part, int& longest) {
  longest = 0;
  for (int i = 1; i < 3; ++i) {
    if (part.half[i] > part.half[longest]) longest = i;
  }
  for (int i = 0; i < 3; ++i) {
    if (i != longest && 2 * part.half[i] > kThick) return false;
  }
  const double length = 2 * part.half[longest];
  return length >= kMinLength && length <= kMaxLength;
}

// Distance by which a part protrudes beyond all others along one axis of the body (m).
double protrusion(const std::vector<Part>& parts, const Part& one, int axis, int sign) {
  const auto reach = [&](const Part& p) { return sign > 0 ? p.box.high[axis] : -p.box.low[axis]; };
  double others = -1e10;
  for (const Part& p : parts) {
    // Other parts of the same handle, such as its posts, are ignored.
    if (p.geom != one.geom && !(one.named && p.named)) others = std::max(others, reach(p));
  }
  return reach(one) - others;
}

std::optional<Handle> find_handle(const std::vector<Part>& parts) {
  if (parts.size() < 2) return {};
  const bool any_named = std::ranges::any_of(parts, &Part::named);
  std::optional<Handle> best;
  double furthest = kProtrusion;
  for (const Part& part : parts) {
    int longest = 0;
    if ((any_named && !part.named) || !is_bar(part, longest)) continue;
    for (int axis = 0; axis < 3; ++axis) {
      for (int sign = -1; sign <= 1; sign += 2) {
        const Vec3 outward{axis == 0 ? double(sign) : 0, axis == 1 ? double(sign) : 0,
                           axis == 2 ? double(sign) : 0};
        Vec3 direction = axis_of(part.pose, longest);
        // A bar must be perpendicular to the direction in which it protrudes. A knob has no long
        // side.
        if (std::abs(dot(direction, outward)) > 0.5) {
          const int other = (longest + 1) % 3;
          direction = axis_of(part.pose, other);
          if (2 * part.half[longest] > kThick) continue;
        }
        const double out = protrusion(parts, part, axis, sign);
        if (out <= furthest) continue;
        furthest = out;
        Handle handle{part.geom, part.pose.p, direction, half_length(part, direction),
                      outward,   0,           0};
        handle.half_across = half_length(part, normalized(cross(direction, outward)));
        handle.half_outward = half_length(part, outward);
        best = handle;
      }
    }
  }
  return best;
}

std::string category_of(const mjModel* m, int body, bool slide) {
  std::string found;
  for (int b = body; b > 0 && found.empty(); b = m->body_parentid[b]) {
    const std::string name = lower(scene::name_of(m, mjOBJ_BODY, b));
    for (const auto& [word, category] : kWordsOfThings) {
      // "door" is ambiguous: it counts only in the name of a top-level body with the joint.
      // Otherwise the names of ancestors decide, then the name of the joint.
      if (category == "door" && b != body) continue;
      if (name.find(word) != name.npos && !(category == "door" && m->body_parentid[b] > 0)) {
        found = category;
        break;
      }
    }
  }
  if (found.empty()) {
    for (int j = m->body_jntadr[body]; j < m->body_jntadr[body] + m->body_jntnum[body]; ++j) {
      const std::string name = lower(scene::name_of(m, mjOBJ_JOINT, j));
      for (const auto& [word, category] : kWordsOfThings) {
        if (found.empty() && name.find(word) != name.npos) found = category;
      }
    }
  }
  return found.empty() ? (slide ? "drawer" : "door") : found;
}

}  // namespace

double Articulation::at(double f) const {
  const double sign = open >= closed ? 1 : -1;
  return std::clamp(sign * f * range(), low, high);
}

Pose Articulation::motion(double from, double to, Vec3 axis, Vec3 anchor) const {
  if (slide) return {(to - from) * axis, {}};
  const Quat q = axis_angle(axis, to - from);
  return {anchor - rotate(q, anchor), q};
}

std::vector<Articulation> find_articulations(const mjModel* m, std::string_view robot_prefix) {
  std::vector<char> driven(m->njnt, 0);
  for (int a = 0; a < m->nu; ++a) {
    const int type = m->actuator_trntype[a], id = m->actuator_trnid[2 * a];
    if (type == mjTRN_JOINT || type == mjTRN_JOINTINPARENT) driven[id] = 1;
    if (type != mjTRN_TENDON) continue;
    for (int w = m->tendon_adr[id]; w < m->tendon_adr[id] + m->tendon_num[id]; ++w) {
      if (m->wrap_type[w] == mjWRAP_JOINT) driven[m->wrap_objid[w]] = 1;
    }
  }
  std::vector<Articulation> found;
  for (int j = 0; j < m->njnt; ++j) {
    const bool slide = m->jnt_type[j] == mjJNT_SLIDE;
    if ((!slide && m->jnt_type[j] != mjJNT_HINGE) || !m->jnt_limited[j] || driven[j]) continue;
    const int body = m->jnt_bodyid[j];
    if (m->body_jntnum[body] != 1) continue;
    // Skip joints of the robot and joints of bodies that have an ancestor with a joint.
    const std::string root = scene::name_of(m, mjOBJ_BODY, m->body_rootid[body]);
    const std::string name = scene::name_of(m, mjOBJ_BODY, body);
    if (!robot_prefix.empty() && (root.starts_with(robot_prefix) || name.starts_with(robot_prefix)))
      continue;
    bool carried = false;
    for (int b = m->body_parentid[body]; b > 0; b = m->body_parentid[b])
      carried = carried || m->body_jntnum[b] > 0;
    if (carried) continue;
    Articulation one;
    one.joint = j;
    one.body = body;
    one.qpos = m->jnt_qposadr[j];
    one.dof = m->jnt_dofadr[j];
    one.slide = slide;
    one.low = m->jnt_range[2 * j];
    one.high = m->jnt_range[2 * j + 1];
    if (one.range() < (slide ? kMinTravel : kMinSwing)) continue;
    const bool low_is_closed = std::abs(one.low) <= std::abs(one.high);
    one.closed = std::clamp(0.0, one.low, one.high);
    one.open = low_is_closed ? one.high : one.low;
    const std::optional<Handle> handle = find_handle(parts_of(m, body));
    if (!handle) continue;
    one.handle = *handle;
    if (!slide) {
      const Vec3 lever = one.handle.middle - vec3(m->jnt_pos + 3 * j),
                 axis = vec3(m->jnt_axis + 3 * j);
      if (norm(lever - dot(lever, axis) * axis) < kMinLever) continue;
    }
    one.name = name;
    one.category = category_of(m, body, slide);
    // A slide of a cabinet that moves along the handle's outward direction is a drawer.
    const double pull = dot(vec3(m->jnt_axis + 3 * j), one.handle.outward);
    if (slide && one.category == "cabinet" && std::abs(pull) > 0.7) one.category = "drawer";
    one.text = one.category;
    found.push_back(std::move(one));
  }
  return found;
}

}  // namespace mjsense::tasks
