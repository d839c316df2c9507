// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/pick_and_place/support_check.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/touches.h"

namespace mjsense::tasks {
namespace {

const double kSteep = std::cos(30 * std::numbers::pi / 180);
constexpr double kShare = 0.5;    // minimum fraction of the weight; of the box seen from above
constexpr double kClose = 0.010;  // m
constexpr int kOutline = 8;       // number of tested points on the outline
constexpr double kRim = 0.9;      // fraction of the half extents
constexpr double kAbove = 0.05;   // m, height from which rays are cast downwards

using observe::each_touch, observe::Touch;

Vec3 force_of(const World& world, const Touch& touch) {
  double f[6];
  mj_contactForce(world.model, world.data, touch.id, f);
  const double* r = touch.contact->frame;  // rows are the axes
  Vec3 sum;
  for (int k = 0; k < 3; ++k) sum = sum + (touch.sign * f[k]) * vec3(r + 3 * k);
  return sum;
}

}  // namespace

Aabb world_box(const World& world, int body) {
  const mjModel* m = world.model;
  Aabb box;
  double* const low[3] = {&box.low.x, &box.low.y, &box.low.z};
  double* const high[3] = {&box.high.x, &box.high.y, &box.high.z};
  for (int g = 0; g < m->ngeom; ++g) {
    if (!observe::is_descendant_or_self(m, m->geom_bodyid[g], body)) continue;
    const double *r = world.data->geom_xmat + 9 * g, *aabb = m->geom_aabb + 6 * g;
    for (int k = 0; k < 3; ++k) {
      double middle = world.data->geom_xpos[3 * g + k], half = 0;
      for (int i = 0; i < 3; ++i) {
        middle += r[3 * k + i] * aabb[i];
        half += std::abs(r[3 * k + i]) * aabb[3 + i];
      }
      *low[k] = std::min(*low[k], middle - half);
      *high[k] = std::max(*high[k], middle + half);
    }
  }
  return box;
}

Aabb turned_box(const World& world, int body, const Quat& turn) {
  const mjModel* m = world.model;
  const Vec3 origin = vec3(world.data->xpos + 3 * body);
  Aabb box;
  for (int g = 0; g < m->ngeom; ++g) {
    if (!observe::is_descendant_or_self(m, m->geom_bodyid[g], body)) continue;
    const Pose geom = geom_pose(world.data, g);
    const Pose turned{origin + rotate(turn, geom.p - origin), turn * geom.q};
    for (Vec3 corner : geom_corners(m, g)) box.add(turned * corner);
  }
  return box;
}

Vec3 contact_force(const World& world, int carrier, int object) {
  Vec3 sum;
  each_touch(world, object, [&](const Touch& touch) {
    if (observe::is_descendant_or_self(world.model, touch.other, carrier))
      sum = sum + force_of(world, touch);
  });
  return sum;
}

bool bears(const World& world, Vec3 force, int object) {
  const double weight =
      world.model->body_subtreemass[object] * norm(vec3(world.model->opt.gravity));
  return force.z > 0 && force.z >= kSteep * norm(force) && force.z >= kShare * weight;
}

bool likely_supports(const World& world, int carrier, int object) {
  const Aabb box = world_box(world, object), below = world_box(world, carrier);
  bool found = false;
  each_touch(world, object, [&](const Touch& touch) {
    if (found || !observe::is_descendant_or_self(world.model, touch.other, carrier)) return;
    found =
        touch.contact->pos[2] < box.center().z && touch.sign * touch.contact->frame[2] >= kSteep;
  });
  if (found) return true;
  const double wide = std::min(box.high.x, below.high.x) - std::max(box.low.x, below.low.x);
  const double deep = std::min(box.high.y, below.high.y) - std::max(box.low.y, below.low.y);
  const double whole = (box.high.x - box.low.x) * (box.high.y - box.low.y);
  return wide > 0 && deep > 0 && wide * deep >= kShare * whole &&
         std::abs(box.low.z - below.high.z) <= kClose;
}

int supporting_body(const World& world, int object) {
  int best = -1;
  double maximum = 0;
  each_touch(world, object, [&](const Touch& one) {
    // The force of a root body is summed again for each of its contacts. This is cheap, because
    // there are few contacts.
    const int root = world.model->body_rootid[one.other];
    Vec3 sum;
    each_touch(world, object, [&](const Touch& touch) {
      if (world.model->body_rootid[touch.other] == root) sum = sum + force_of(world, touch);
    });
    if (!bears(world, sum, object) || sum.z <= maximum) return;
    maximum = sum.z;
    best = root;
  });
  return best;
}

bool is_supported_over_whole_area(const World& world, Vec3 middle, Vec3 half, int carrier,
                                  int object) {
  const mjModel* m = world.model;
  const double down[3] = {0, 0, -1};
  for (int k = 0; k <= kOutline; ++k) {
    const double a = 2 * std::numbers::pi * k / kOutline, r = k == kOutline ? 0 : kRim;
    const double from[3] = {middle.x + r * half.x * std::cos(a),
                            middle.y + r * half.y * std::sin(a), middle.z + kAbove};
    int geom = -1;
    const double far = mj_ray(m, world.data, from, down, nullptr, 1, object, &geom, nullptr);
    if (geom < 0 || std::abs(far - kAbove) > kClose ||
        m->body_rootid[m->geom_bodyid[geom]] != carrier)
      return false;
  }
  return true;
}

double gap_from_above(const Aabb& a, const Aabb& b) {
  const double x = std::max(a.low.x - b.high.x, b.low.x - a.high.x);
  const double y = std::max(a.low.y - b.high.y, b.low.y - a.high.y);
  if (x < 0 && y < 0) return std::max(x, y);
  return std::hypot(std::max(x, 0.0), std::max(y, 0.0));
}

bool touched_by(const World& world, int body, int other_root) {
  bool found = false;
  each_touch(world, body, [&](const Touch& touch) {
    found = found || observe::is_descendant_or_self(world.model, touch.other, other_root);
  });
  return found;
}

}  // namespace mjsense::tasks
