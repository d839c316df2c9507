// SPDX-License-Identifier: Apache-2.0
#pragma once
// The law of noise on commands.

#include <cmath>

#include "mjsense/core/rng.h"

namespace mjsense {

// Normal with this deviation, drawn again beyond +-limit.
inline double truncated_normal(Rng& rng, double deviation, double limit) {
  if (!(deviation > 0)) return 0.0;
  // Far inside the bell the distribution is flat, and rejection would take for ever.
  if (deviation > 100 * limit) return rng.uniform(-limit, limit);
  for (;;) {
    const double x = deviation * rng.normal();
    if (std::abs(x) <= limit) return x;
  }
}

}  // namespace mjsense
