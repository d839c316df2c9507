// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/contact/contact_reducer.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "mjsense/core/error.h"

namespace mjsense::sensors {
namespace {

bool belongs(const mjModel* m, int geom, ContactMode mode, int id) {
  if (mode == ContactMode::kGeom) return geom == id;
  int body = m->geom_bodyid[geom];
  if (mode == ContactMode::kBody) return body == id;
  while (body > id) body = m->body_parentid[body];  // a parent's id is smaller than its child's
  return body == id;
}

}  // namespace

ContactReducer::Lists ContactReducer::lists_of(const mjModel* m,
                                               const std::vector<ContactObject>& objects,
                                               ContactMode mode) {
  Lists lists;
  for (int g = 0; g < m->ngeom; ++g) {
    lists.begin.push_back(static_cast<int>(lists.values.size()));
    for (int k = 0; k < static_cast<int>(objects.size()); ++k) {
      if (belongs(m, g, mode, objects[k].id)) lists.values.push_back(k);
    }
  }
  lists.begin.push_back(static_cast<int>(lists.values.size()));
  return lists;
}

ContactReducer::ContactReducer(const mjModel* m, int num_worlds, const Config& config)
    : reduce_(config.reduce),
      num_primaries_(static_cast<int>(config.primaries.size())),
      num_slots_(config.num_slots),
      num_secondaries_(static_cast<int>(config.secondaries.size())),
      any_other_(config.secondaries.empty()),
      keep_pairs_(config.keep_pairs),
      primary_of_geom_(lists_of(m, config.primaries, config.primary_mode)),
      secondary_of_geom_(lists_of(m, config.secondaries, config.secondary_mode)) {
  for (int g = 0; g < m->ngeom; ++g) other_.push_back(!list(secondary_of_geom_, g).empty());
  const std::size_t n = static_cast<std::size_t>(num_worlds) * num_primaries_;
  touched_.resize(n);
  num_touched_.resize(num_worlds);
  count_.resize(n);
  if (is_net()) {
    sums_.resize(n);
  } else {
    slots_.resize(n * num_slots_);
    if (config.keep_peak && reduce_ != ContactReduce::kMaxForce) peaks_.resize(n);
  }
  if (keep_pairs_) {
    pair_count_.resize(n * num_secondaries_);
    pair_force_.resize(n * num_secondaries_ * 3);
  }
}

void ContactReducer::begin(int world) {
  for (int p : touched(world)) {
    const std::size_t row = static_cast<std::size_t>(world) * num_primaries_ + p;
    count_[row] = 0;
    if (keep_pairs_) {
      std::fill_n(pair_count_.begin() + row * num_secondaries_, num_secondaries_, 0);
      std::fill_n(pair_force_.begin() + row * num_secondaries_ * 3, num_secondaries_ * 3, 0.0);
    }
  }
  num_touched_[world] = 0;
}

void ContactReducer::add(int world, int primary, PassContact& contact, int sign) {
  const std::size_t row = static_cast<std::size_t>(world) * num_primaries_ + primary;
  const int before = count_[row]++;
  if (before == 0) touched_[world * num_primaries_ + num_touched_[world]++] = primary;
  ContactRef* slots = slots_.data() + row * num_slots_;
  switch (reduce_) {
    case ContactReduce::kNone:
      if (before < num_slots_) slots[before] = {0.0, contact.id, sign};
      break;
    case ContactReduce::kMinDist:
      insert(slots, before, {contact.contact.dist, contact.id, sign});
      break;
    case ContactReduce::kMaxForce:
      insert(slots, before, {-contact.force_norm(), contact.id, sign});
      break;
    case ContactReduce::kNetForce:
      add_to_sum(sums_[row], before == 0, contact, sign);
      break;
  }
  if (!peaks_.empty()) {
    const double key = -contact.force_norm();
    if (before == 0 || key < peaks_[row].key) peaks_[row] = {key, contact.id, sign};
  }
  if (keep_pairs_) add_to_pairs(world, primary, contact, sign, {});
}

void ContactReducer::add_other_path(int world, int primary, PassContact& contact) {
  if (!keep_pairs_) return;
  add_to_pairs(world, primary, contact, -1, list(secondary_of_geom_, contact.contact.geom[1]));
}

// Keeps slots sorted by key; contacts with equal keys stay in the order of the contact list.
void ContactReducer::insert(ContactRef* slots, int filled, const ContactRef& ref) const {
  int k = std::min(filled, num_slots_);
  if (k == num_slots_ && !(ref.key < slots[k - 1].key)) return;
  if (k == num_slots_) --k;
  for (; k > 0 && ref.key < slots[k - 1].key; --k) slots[k] = slots[k - 1];
  slots[k] = ref;
}

void ContactReducer::add_to_sum(ContactSum& sum, bool is_first, PassContact& contact,
                                int sign) const {
  const mjContact& c = contact.contact;
  if (is_first) {
    sum = {};
    std::copy_n(c.pos, 3, sum.origin);
  }
  const mjtNum* f = contact.wrench();
  const double weight = contact.force_norm();
  double force[3], torque[3], arm[3], moment[3];
  for (int i = 0; i < 3; ++i) {
    force[i] = sign * (f[0] * c.frame[i] + f[1] * c.frame[3 + i] + f[2] * c.frame[6 + i]);
    torque[i] = sign * (f[3] * c.frame[i] + f[4] * c.frame[3 + i] + f[5] * c.frame[6 + i]);
    arm[i] = c.pos[i] - sum.origin[i];
    sum.normal_force[i] += sign * f[0] * c.frame[i];
  }
  mju_cross(moment, arm, force);
  for (int i = 0; i < 3; ++i) {
    sum.force[i] += force[i];
    sum.moment[i] += torque[i] + moment[i];
    sum.weighted_pos[i] += weight * arm[i];
  }
  sum.weight += weight;
  if (is_first || -weight < sum.strongest.key) sum.strongest = {-weight, contact.id, sign};
}

void ContactReducer::add_to_pairs(int world, int primary, PassContact& contact, int sign,
                                  std::span<const int> had) {
  const mjContact& c = contact.contact;
  const mjtNum* f = contact.wrench();
  for (int s : list(secondary_of_geom_, c.geom[sign > 0 ? 1 : 0])) {
    if (std::find(had.begin(), had.end(), s) != had.end()) continue;
    const std::size_t pair =
        (static_cast<std::size_t>(world) * num_primaries_ + primary) * num_secondaries_ + s;
    ++pair_count_[pair];
    for (int i = 0; i < 3; ++i) {
      pair_force_[pair * 3 + i] +=
          sign * (f[0] * c.frame[i] + f[1] * c.frame[3 + i] + f[2] * c.frame[6 + i]);
    }
  }
}

const ContactRef& ContactReducer::peak(int world, int primary) const {
  const std::size_t row = static_cast<std::size_t>(world) * num_primaries_ + primary;
  return peaks_.empty() ? slots_[row * num_slots_] : peaks_[row];
}

std::span<const std::int32_t> ContactReducer::pair_count(int world) const {
  const std::size_t n = static_cast<std::size_t>(num_primaries_) * num_secondaries_;
  return {pair_count_.data() + world * n, n};
}

std::span<const double> ContactReducer::pair_force(int world) const {
  const std::size_t n = static_cast<std::size_t>(num_primaries_) * num_secondaries_ * 3;
  return {pair_force_.data() + world * n, n};
}

}  // namespace mjsense::sensors
