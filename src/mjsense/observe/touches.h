// SPDX-License-Identifier: Apache-2.0
#pragma once
// The contacts of a body and its descendants with all other bodies.

#include "mjsense/core/sensor.h"
#include "mjsense/observe/frame.h"

namespace mjsense::observe {

struct Touch {
  const mjContact* contact;
  int id;          // of the contact
  int own, other;  // bodies; `own` is the body or a descendant of it
  double sign;     // makes the contact's normal point towards `own`
};

// Calls f(Touch) for each of them. None for body < 0.
template <class F>
void each_touch(const mjModel* m, const mjData* d, int body, F&& f) {
  for (int i = 0; i < d->ncon; ++i) {
    const mjContact& contact = d->contact[i];
    if (contact.exclude != 0 || contact.geom[0] < 0 || contact.geom[1] < 0) continue;
    const int a = m->geom_bodyid[contact.geom[0]], b = m->geom_bodyid[contact.geom[1]];
    const bool second = is_descendant_or_self(m, b, body);
    if (is_descendant_or_self(m, a, body) == second) continue;
    f(second ? Touch{&contact, i, b, a, 1} : Touch{&contact, i, a, b, -1});
  }
}
template <class F>
void each_touch(const World& world, int body, F&& f) {
  each_touch(world.model, world.data, body, f);
}

}  // namespace mjsense::observe
