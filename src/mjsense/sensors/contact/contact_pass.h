// SPDX-License-Identifier: Apache-2.0
#pragma once
// One pass over mjData.contact per world and moment, for all contact sensors that need it at the
// same time. A table from each geom to its primaries makes the cost proportional to the number of
// contacts, independent of the number of primaries and fields.

#include <cstdint>
#include <span>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/sensors/contact/contact_reducer.h"

namespace mjsense::sensors {

class ContactPass {
 public:
  ContactPass(const mjModel* model, int num_worlds);

  // The reducer must remain valid until the last run() of the pass.
  void join(ContactReducer* reducer);

  // Computes the results of all reducers for this world, unless that was done for the current
  // moment.
  void run(const World& world);

 private:
  struct Entry {
    int reducer, primary;
  };
  std::span<const Entry> entries(int geom) const {
    if (geom < 0) return {};  // a flex
    return {entries_.data() + begin_[geom], entries_.data() + begin_[geom + 1]};
  }

  int num_geoms_;
  std::vector<ContactReducer*> reducers_;
  std::vector<int> begin_;  // entries of geom g: begin_[g] .. begin_[g + 1]
  std::vector<Entry> entries_;
  std::vector<std::uint64_t> moment_;  // [B] of the last run
};

}  // namespace mjsense::sensors
