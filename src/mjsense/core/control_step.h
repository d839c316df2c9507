// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

namespace mjsense {

// A sensor that is one of these hears of every control step, read or not: for clocks and filters
// whose state goes on at the control rate.
class ControlStepListener {
 public:
  virtual ~ControlStepListener() = default;
  // The worlds `ids` (sorted) have made a control step. On the caller's thread, before any cast() of
  // that step; reset() of those whose physics failed in it came before. Throws RowError for a world
  // whose row it makes impossible.
  virtual void control_step(std::span<const int> ids) = 0;
};

}  // namespace mjsense
