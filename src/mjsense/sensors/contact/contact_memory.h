#pragma once
// What a contact sensor remembers from substep to substep: air and contact times, touchdown and
// lift-off, and the latch over a control step.

#include <cstdint>
#include <span>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/sensors/contact/contact_reading.h"

namespace mjsense {

class ContactMemory {
 public:
  // Where it writes; null: not asked for.
  struct Fields {
    Array *current_air = nullptr, *last_air = nullptr, *current_contact = nullptr,
          *last_contact = nullptr;
    Array *touchdown = nullptr, *liftoff = nullptr;
    Array *found_any = nullptr, *force_peak = nullptr, *dist_at_peak = nullptr,
          *pos_at_peak = nullptr, *first_touch_time = nullptr;
  };
  ContactMemory() = default;
  ContactMemory(int num_worlds, int num_primaries, int decimation, const Fields& fields);

  // One substep. First next_substep(), then strike() for every primary in contact.
  void next_substep(const World& world, const ContactReducer& contacts);
  bool wants_strikes() const { return fields_.found_any != nullptr; }
  void strike(const World& world, int primary, double force_norm, const ContactReading& reading);

  void begin_control_step(int world) { substep_[world] = 0; }
  void reset(int world, const ContactReducer& contacts);

 private:
  void clear_step(int world);
  void update_time(const World& world, const ContactReducer& contacts);
  void update_events(const World& world, const ContactReducer& contacts);

  Fields fields_;
  int num_primaries_ = 0, decimation_ = 1;
  std::vector<int> substep_;         // of the control step, by world
  std::vector<double> since_;        // [B, P] s in contact if > 0, in the air if < 0
  std::vector<double> step_time_;    // [B] s since the control step began
  std::vector<double> peak_;         // [B, P] greatest force norm of the step, -1 without contact
  std::vector<std::uint8_t> touch_;  // [B, P] contact at the last substep
};

}  // namespace mjsense
