// SPDX-License-Identifier: Apache-2.0
#pragma once
// The worlds that a call about many of them is for.

#include <functional>
#include <span>

#include "mjsense/core/sensor.h"

namespace mjsense {

class ActiveWorlds {
 public:
  virtual ~ActiveWorlds() = default;
  virtual std::span<const int> ids() const = 0;  // in order
  // `body` of each of them, in parallel, on fresh data. What it captures should fit two pointers:
  // more is allocated.
  virtual void for_each(std::function<void(const World&)> body) = 0;
};

}  // namespace mjsense
