// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/contact/contact_reading.h"

#include <algorithm>

namespace mjsense::sensors {
namespace {

void set_other(const World& world, const mjContact& c, int sign, ContactReading& r) {
  r.other_geom = c.geom[sign > 0 ? 1 : 0];
  r.other_body = r.other_geom >= 0 ? world.model->geom_bodyid[r.other_geom] : -1;
}

// out = sign * frame^T v: from the contact frame to world axes.
void to_world(double out[3], const mjContact& c, int sign, double x, double y, double z) {
  for (int i = 0; i < 3; ++i) {
    out[i] = sign * (x * c.frame[i] + y * c.frame[3 + i] + z * c.frame[6 + i]);
  }
}

}  // namespace

ContactReading read_contact(const World& world, const ContactRef& ref, bool wrench, bool global) {
  const mjContact& c = world.data->contact[ref.contact];
  const int s = ref.sign;
  ContactReading r;
  r.dist = c.dist;
  for (int i = 0; i < 3; ++i) {
    r.pos[i] = c.pos[i];
    r.normal[i] = s * c.frame[i];
    r.tangent[i] = s * c.frame[3 + i];
  }
  set_other(world, c, s, r);
  if (!wrench) return r;
  mjtNum f[6];
  contact_wrench(world.model, world.data, ref.contact, f);
  if (global) {
    to_world(r.force, c, s, f[0], f[1], f[2]);
    to_world(r.torque, c, s, f[3], f[4], f[5]);
    to_world(r.normal_force, c, s, f[0], 0, 0);
    to_world(r.friction_force, c, s, 0, f[1], f[2]);
  } else {
    // The flipped frame is (-n, -t, n x t): in it, only the third component of the opposite wrench
    // is flipped.
    for (int i = 0; i < 3; ++i) {
      r.force[i] = i == 2 ? s * f[i] : f[i];
      r.torque[i] = i == 2 ? s * f[3 + i] : f[3 + i];
    }
    r.normal_force[0] = r.force[0];
    std::copy_n(r.force + 1, 2, r.friction_force + 1);
  }
  return r;
}

ContactReading read_net_contact(const World& world, const ContactSum& sum) {
  ContactReading r;
  double arm[3], moment[3];
  // Contacts in the gap have no centroid; the position is then the origin, as in MuJoCo.
  const bool loaded = sum.weight > 0;
  for (int i = 0; i < 3; ++i) {
    arm[i] = loaded ? sum.weighted_pos[i] / sum.weight : 0.0;
    r.pos[i] = loaded ? sum.origin[i] + arm[i] : 0.0;
    r.force[i] = sum.force[i];
    r.normal_force[i] = sum.normal_force[i];
    r.friction_force[i] = sum.force[i] - sum.normal_force[i];
  }
  mju_cross(moment, arm, sum.force);
  for (int i = 0; i < 3; ++i) r.torque[i] = sum.moment[i] - moment[i];
  r.normal[0] = r.tangent[1] = 1.0;
  set_other(world, world.data->contact[sum.strongest.contact], sum.strongest.sign, r);
  return r;
}

}  // namespace mjsense::sensors
