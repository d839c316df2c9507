// SPDX-License-Identifier: Apache-2.0
#pragma once
// Values of one slot of a contact sensor in double precision, read from mjData for a selected
// contact.

#include "mjsense/core/sensor.h"
#include "mjsense/sensors/contact/contact_reducer.h"

namespace mjsense::sensors {

struct ContactReading {
  double force[3]{}, torque[3]{};                 // N, N m; of the primary on the other side
  double normal_force[3]{}, friction_force[3]{};  // their sum is force
  double dist = 0.0;                              // m, negative in penetration
  double pos[3]{};                                // m, world
  double normal[3]{}, tangent[3]{};  // unit, world; the normal points away from the primary
  int other_geom = -1, other_body = -1;
};

// Components are in the contact frame, or in world axes if `global`. Without `wrench` the forces
// stay 0.
ContactReading read_contact(const World& world, const ContactRef& ref, bool wrench, bool global);

// The synthetic contact of netforce, in world axes, at the force-weighted centroid.
ContactReading read_net_contact(const World& world, const ContactSum& sum);

}  // namespace mjsense::sensors
