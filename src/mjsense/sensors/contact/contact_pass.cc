// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/contact/contact_pass.h"

#include <algorithm>

namespace mjsense::sensors {

ContactPass::ContactPass(const mjModel* model, int num_worlds)
    : num_geoms_(model->ngeom), begin_(model->ngeom + 1), moment_(num_worlds) {}

void ContactPass::join(ContactReducer* reducer) {
  reducers_.push_back(reducer);
  entries_.clear();
  for (int g = 0; g < num_geoms_; ++g) {
    begin_[g] = static_cast<int>(entries_.size());
    for (int r = 0; r < static_cast<int>(reducers_.size()); ++r) {
      for (int p : reducers_[r]->primaries_of(g)) entries_.push_back({r, p});
    }
  }
  begin_[num_geoms_] = static_cast<int>(entries_.size());
  std::fill(moment_.begin(), moment_.end(), 0);
}

void ContactPass::run(const World& world) {
  if (world.moment != 0 && moment_[world.id] == world.moment) return;
  moment_[world.id] = world.moment;
  for (ContactReducer* r : reducers_) r->begin(world.id);
  const mjData* d = world.data;
  for (int i = 0; i < d->ncon; ++i) {
    const int g1 = d->contact[i].geom[0], g2 = d->contact[i].geom[1];
    const std::span<const Entry> first = entries(g1), second = entries(g2);
    if (first.empty() && second.empty()) continue;
    PassContact contact(world, i);
    for (const Entry& e : first) {
      ContactReducer& r = *reducers_[e.reducer];
      if (r.accepts_other(g2)) r.add(world.id, e.primary, contact, 1);
    }
    for (const Entry& e : second) {
      ContactReducer& r = *reducers_[e.reducer];
      if (!r.accepts_other(g1)) continue;
      // If a primary is on both sides (a subtree in contact with itself), the contact counts once,
      // as geom 1.
      const bool counted =
          r.accepts_other(g2) && std::any_of(first.begin(), first.end(), [&](const Entry& other) {
            return other.reducer == e.reducer && other.primary == e.primary;
          });
      if (counted) {
        r.add_other_path(world.id, e.primary, contact);
      } else {
        r.add(world.id, e.primary, contact, -1);
      }
    }
  }
}

}  // namespace mjsense::sensors
