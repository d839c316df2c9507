// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/contact/contact_memory.h"

#include <algorithm>

namespace mjsense::sensors {
ContactMemory::ContactMemory(int num_worlds, int num_primaries, int decimation,
                             const Fields& fields)
    : fields_(fields), num_primaries_(num_primaries), decimation_(decimation) {
  const std::size_t n = static_cast<std::size_t>(num_worlds) * num_primaries;
  substep_.resize(num_worlds);
  step_time_.resize(num_worlds);
  if (fields_.current_air) since_.resize(n);
  if (fields_.touchdown) touch_.resize(n);
  if (fields_.found_any) peak_.resize(n);
  for (int w = 0; w < num_worlds; ++w) clear_step(w);
}

void ContactMemory::next_substep(const World& world, const ContactReducer& contacts) {
  const int w = world.id;
  if (substep_[w] == 0) clear_step(w);
  if (++substep_[w] == decimation_) substep_[w] = 0;
  step_time_[w] += world.dt();
  if (fields_.current_air) update_time(world, contacts);
  if (fields_.touchdown) update_events(world, contacts);
}

void ContactMemory::update_time(const World& world, const ContactReducer& contacts) {
  const int w = world.id;
  const double dt = world.dt();
  double* since = since_.data() + static_cast<std::size_t>(w) * num_primaries_;
  float* air = fields_.current_air(w);
  float* last_air = fields_.last_air(w);
  float* contact = fields_.current_contact(w);
  float* last_contact = fields_.last_contact(w);
  for (int p = 0; p < num_primaries_; ++p) {
    double t = since[p];
    if (contacts.count(w, p) > 0) {
      if (t < 0) last_air[p] = static_cast<float>(dt - t);
      t = t > 0 ? t + dt : dt;
    } else {
      if (t > 0) last_contact[p] = static_cast<float>(t + dt);
      t = t < 0 ? t - dt : -dt;
    }
    since[p] = t;
    air[p] = t < 0 ? static_cast<float>(-t) : 0.0f;
    contact[p] = t > 0 ? static_cast<float>(t) : 0.0f;
  }
}

void ContactMemory::update_events(const World& world, const ContactReducer& contacts) {
  const int w = world.id;
  Touch* touch = touch_.data() + static_cast<std::size_t>(w) * num_primaries_;
  bool* touchdown = fields_.touchdown(w);
  bool* liftoff = fields_.liftoff(w);
  for (int p = 0; p < num_primaries_; ++p) {
    const Touch now = contacts.count(w, p) > 0 ? Touch::kContact : Touch::kAir;
    touchdown[p] |= now == Touch::kContact && touch[p] == Touch::kAir;
    liftoff[p] |= now == Touch::kAir && touch[p] == Touch::kContact;
    touch[p] = now;
  }
}

bool ContactMemory::add_contact(int w, int p, double force_norm) {
  fields_.found_any(w)[p] = true;
  float& first = fields_.first_touch_time(w)[p];
  if (first < 0) first = static_cast<float>(step_time_[w]);
  double& peak = peak_[static_cast<std::size_t>(w) * num_primaries_ + p];
  if (force_norm <= peak) return false;
  peak = force_norm;
  return true;
}

void ContactMemory::set_peak(int w, int p, const ContactReading& reading) {
  fields_.dist_at_peak(w)[p] = static_cast<float>(reading.dist);
  for (int i = 0; i < 3; ++i) {
    fields_.force_peak(w)[3 * p + i] = static_cast<float>(reading.force[i]);
    fields_.pos_at_peak(w)[3 * p + i] = static_cast<float>(reading.pos[i]);
  }
}

void ContactMemory::clear_step(int w) {
  step_time_[w] = 0.0;
  if (fields_.touchdown) {
    fields_.touchdown.fill(w, false);
    fields_.liftoff.fill(w, false);
  }
  if (fields_.found_any) {
    fields_.found_any.fill(w, false);
    for (const auto& rows : {fields_.force_peak, fields_.dist_at_peak, fields_.pos_at_peak})
      rows.fill(w, 0.0f);
    fields_.first_touch_time.fill(w, -1.0f);
    std::fill_n(peak_.begin() + static_cast<std::size_t>(w) * num_primaries_, num_primaries_, -1.0);
  }
}

void ContactMemory::reset(int world) {
  const std::size_t begin = static_cast<std::size_t>(world) * num_primaries_;
  substep_[world] = 0;
  clear_step(world);
  if (fields_.current_air) {
    std::fill_n(since_.begin() + begin, num_primaries_, 0.0);
    for (const auto& rows :
         {fields_.current_air, fields_.last_air, fields_.current_contact, fields_.last_contact})
      rows.fill(world, 0.0f);
  }
  if (fields_.touchdown) std::fill_n(touch_.begin() + begin, num_primaries_, Touch::kUnknown);
}

}  // namespace mjsense::sensors
