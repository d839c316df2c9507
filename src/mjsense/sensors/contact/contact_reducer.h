// SPDX-License-Identifier: Apache-2.0
#pragma once
// Results of a pass for one contact sensor: for each primary a count, and the K best contacts or
// their net wrench. There is no limit except K, and nothing is allocated after construction.

#include <mujoco/mujoco.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/sensors/contact/contact_match.h"

namespace mjsense::sensors {

enum class ContactReduce { kNone, kMinDist, kMaxForce, kNetForce };
constexpr std::array<std::string_view, 4> enum_names(ContactReduce) {
  return {"none", "mindist", "maxforce", "netforce"};
}

// Force and torque in the contact frame. Equal to mj_contactForce, which is called only for
// contacts that are not plain constraints. The edges of a pyramidal cone come in pairs, one pair
// for each friction direction.
inline void contact_wrench(const mjModel* m, const mjData* d, int id, mjtNum wrench[6]) {
  const mjContact& c = d->contact[id];
  const bool plain =
      c.exclude == 0 && c.efc_address >= 0 && c.adhesion == 0 && !(m->opt.enableflags & mjENBL_IPC);
  if (!plain) return mj_contactForce(m, d, id, wrench);
  const mjtNum* force = d->efc_force + c.efc_address;
  for (int i = 0; i < 6; ++i) wrench[i] = 0;
  if (c.dim == 1 || m->opt.cone == mjCONE_ELLIPTIC) {
    for (int i = 0; i < c.dim; ++i) wrench[i] = force[i];
    return;
  }
  for (int i = 1; i < c.dim; ++i, force += 2) {
    wrench[0] += force[0];  // one by one as in MuJoCo, so that equal forces stay equal
    wrench[0] += force[1];
    wrench[i] = (force[0] - force[1]) * c.friction[i - 1];
  }
}

// A contact during a pass. Its wrench is computed when it is first needed, once for all sensors.
class PassContact {
 public:
  PassContact(const World& world, int id)
      : contact(world.data->contact[id]), id(id), world_(world) {}

  const mjContact& contact;
  const int id;

  const mjtNum* wrench() {  // contact frame, N and N m
    if (!has_wrench_) {
      contact_wrench(world_.model, world_.data, id, wrench_);
      has_wrench_ = true;
    }
    return wrench_;
  }
  mjtNum force_norm() {
    const mjtNum* f = wrench();
    return std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  }

 private:
  const World& world_;
  mjtNum wrench_[6];
  bool has_wrench_ = false;
};

// A contact as seen from a primary: sign +1 if the primary is geom 1, -1 if it is geom 2.
struct ContactRef {
  double key = 0.0;  // selection criterion; smaller is better
  int contact = -1;  // index in mjData.contact
  int sign = 1;
};

// Sums over the contacts of a primary, world axes. Positions and moments are relative to `origin`,
// the first contact, to avoid cancellation far from the world's origin.
struct ContactSum {
  double origin[3], weight, weighted_pos[3], force[3], normal_force[3], moment[3];
  ContactRef strongest;
};

class ContactReducer {
 public:
  struct Config {
    // Without secondaries, contacts with anything count.
    std::vector<ContactObject> primaries, secondaries;
    ContactMode primary_mode{}, secondary_mode{};
    ContactReduce reduce = ContactReduce::kMaxForce;
    int num_slots = 1;
    // Also keep the strongest of all contacts, whatever `reduce` selects.
    bool keep_peak = false;
    bool keep_pairs = false;  // also keep counts and net forces for each secondary
  };
  ContactReducer() = default;
  ContactReducer(const mjModel* model, int num_worlds, const Config& config);

  // The primaries that a geom belongs to.
  std::span<const int> primaries_of(int geom) const { return list(primary_of_geom_, geom); }
  bool accepts_other(int geom) const { return any_other_ || (geom >= 0 && other_[geom]); }

  void begin(int world);
  void add(int world, int primary, PassContact& contact, int sign);
  // For a contact that was added with the primary as geom 1 and that also matches as geom 2. It is
  // not counted again, but it is added to the pairs with secondaries on the side of geom 1.
  void add_other_path(int world, int primary, PassContact& contact);

  int num_primaries() const { return num_primaries_; }
  int num_slots() const { return num_slots_; }
  int num_secondaries() const { return num_secondaries_; }
  bool is_net() const { return reduce_ == ContactReduce::kNetForce; }

  // Results of the last pass over this world. touched(): primaries with a contact, in the order in
  // which they were found.
  std::span<const int> touched(int world) const {
    return {touched_.data() + world * num_primaries_,
            static_cast<std::size_t>(num_touched_[world])};
  }
  int count(int world, int primary) const { return count_[world * num_primaries_ + primary]; }
  const ContactRef& slot(int world, int primary, int k) const {
    return slots_[(world * num_primaries_ + primary) * num_slots_ + k];
  }
  const ContactSum& sum(int world, int primary) const {
    return sums_[world * num_primaries_ + primary];
  }
  const ContactRef& peak(int world, int primary) const;  // requires keep_peak; not for netforce
  std::span<const std::int32_t> pair_count(int world) const;
  std::span<const double> pair_force(int world) const;  // [P, S, 3]

 private:
  // Lists of values by geom, in one vector: those of geom g are values[begin[g] .. begin[g + 1]).
  struct Lists {
    std::vector<int> begin, values;
  };
  static std::span<const int> list(const Lists& lists, int geom) {
    if (geom < 0) return {};
    return {lists.values.data() + lists.begin[geom], lists.values.data() + lists.begin[geom + 1]};
  }
  static Lists lists_of(const mjModel* model, const std::vector<ContactObject>& objects,
                        ContactMode mode);
  void insert(ContactRef* slots, int filled, const ContactRef& ref) const;
  void add_to_sum(ContactSum& sum, bool is_first, PassContact& contact, int sign) const;
  // `had`: secondaries to which this contact was added before.
  void add_to_pairs(int world, int primary, PassContact& contact, int sign,
                    std::span<const int> had);

  ContactReduce reduce_ = ContactReduce::kNone;
  int num_primaries_ = 0, num_slots_ = 1, num_secondaries_ = 0;
  bool any_other_ = true, keep_pairs_ = false;
  Lists primary_of_geom_, secondary_of_geom_;
  std::vector<std::uint8_t> other_;  // [ngeom] the geom belongs to a secondary
  std::vector<int> touched_, num_touched_;
  std::vector<std::int32_t> count_;
  std::vector<ContactRef> slots_, peaks_;
  std::vector<ContactSum> sums_;
  std::vector<std::int32_t> pair_count_;
  std::vector<double> pair_force_;
};

}  // namespace mjsense::sensors
