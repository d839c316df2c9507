// SPDX-License-Identifier: Apache-2.0
#pragma once
// State that a contact sensor keeps from substep to substep: air and contact times, touchdown and
// lift-off, and the latch over a control step.

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/sensors/contact/contact_reading.h"

namespace mjsense::sensors {

// The rows of a field, without the index computations of Array.
template <class T>
class Rows {
 public:
  Rows() = default;
  explicit Rows(Array& array)
      : base_(reinterpret_cast<T*>(array.data())), size_(array.row<T>(0).size()) {}
  explicit operator bool() const { return base_ != nullptr; }
  T* operator()(int world) const { return base_ + world * size_; }
  void fill(int world, T value) const { std::fill_n((*this)(world), size_, value); }

 private:
  T* base_ = nullptr;
  std::size_t size_ = 0;
};

class ContactMemory {
 public:
  // Output fields; empty if not requested.
  struct Fields {
    Rows<float> current_air, last_air, current_contact, last_contact;
    Rows<bool> touchdown, liftoff;
    Rows<bool> found_any;
    Rows<float> force_peak, dist_at_peak, pos_at_peak, first_touch_time;
  };
  ContactMemory() = default;
  ContactMemory(int num_worlds, int num_primaries, int decimation, const Fields& fields);

  // Call for every substep: first next_substep(), then add_contact() for every primary in contact.
  void next_substep(const World& world, const ContactReducer& contacts);
  bool wants_contacts() const { return static_cast<bool>(fields_.found_any); }
  // Returns true if this is the strongest force of the control step so far; then call set_peak().
  bool add_contact(int world, int primary, double force_norm);
  void set_peak(int world, int primary, const ContactReading& reading);

  void reset(int world);

 private:
  // Phases begin with the first substep of an episode. A contact that exists then is not a
  // touchdown, and a missing one is not a lift-off, whatever state was written after the reset.
  enum class Touch : std::uint8_t { kUnknown, kAir, kContact };

  void clear_step(int world);
  void update_time(const World& world, const ContactReducer& contacts);
  void update_events(const World& world, const ContactReducer& contacts);

  Fields fields_;
  int num_primaries_ = 0, decimation_ = 1;
  std::vector<int> substep_;       // [B] index in the control step
  std::vector<double> since_;      // [B, P] s in contact if > 0, in the air if < 0
  std::vector<double> step_time_;  // [B] s since the control step began
  std::vector<double> peak_;       // [B, P] maximum force norm of the step, -1 without contact
  std::vector<Touch> touch_;       // [B, P] at the last substep
};

}  // namespace mjsense::sensors
