// SPDX-License-Identifier: Apache-2.0
#pragma once
// One walk over mjData.contact per world and moment, for all contact sensors that want it at the
// same time: a table from each geom to the primaries it belongs to makes the cost grow with the
// contacts, not with primaries or fields.

#include <cstdint>
#include <span>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/sensors/contact/contact_reducer.h"

namespace mjsense {

class ContactPass {
 public:
  ContactPass(const mjModel* model, int num_worlds);

  // The reducer must outlive the pass's last run().
  void join(ContactReducer* reducer);

  // Fills every reducer's results for this world. Does nothing if it did so at this moment.
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
  std::vector<std::uint64_t> moment_;  // of the last run, by world
};

}  // namespace mjsense
