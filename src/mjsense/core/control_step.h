// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

namespace mjsense {

// A sensor that derives from this class is notified of every control step, whether or not it is
// read. Used for clocks and filters whose state advances at the control rate.
class ControlStepListener {
 public:
  virtual ~ControlStepListener() = default;
  // Called after the worlds `ids` (sorted) have made a control step, on the caller's thread, before
  // any cast() of that step and after reset() of the worlds whose physics failed in it. Throws
  // RowError for a world whose row cannot be computed.
  virtual void control_step(std::span<const int> ids) = 0;
};

}  // namespace mjsense
