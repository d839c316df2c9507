// SPDX-License-Identifier: Apache-2.0
#pragma once
// Distribution of the noise on commands.

#include <cmath>

#include "mjsense/core/rng.h"

namespace mjsense::tasks::robots {

// Normal distribution with standard deviation `deviation`, truncated to +-limit.
inline double truncated_normal(Rng& rng, double deviation, double limit) {
  if (!(deviation > 0)) return 0.0;
  // Here the density is almost uniform, and rejection sampling would take too long.
  if (deviation > 100 * limit) return rng.uniform(-limit, limit);
  for (;;) {
    const double x = deviation * rng.normal();
    if (std::abs(x) <= limit) return x;
  }
}

}  // namespace mjsense::tasks::robots
