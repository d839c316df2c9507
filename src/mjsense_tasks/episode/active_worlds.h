// SPDX-License-Identifier: Apache-2.0
#pragma once
// The set of worlds that a call for many worlds is about.

#include <functional>
#include <span>

#include "mjsense/core/sensor.h"

namespace mjsense::tasks::episode {

class ActiveWorlds {
 public:
  virtual ~ActiveWorlds() = default;
  virtual std::span<const int> ids() const = 0;  // in order
  // Calls `body` for each of them, in parallel, with current data. Captures should fit into two
  // pointers; larger ones are allocated.
  virtual void for_each(std::function<void(const World&)> body) = 0;
};

}  // namespace mjsense::tasks::episode
