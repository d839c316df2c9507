// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/config_checks.h"
#include "mjsense/core/text/counted.h"

namespace mjsense::effects {

void check_order(const PerComponent& low, const PerComponent& high, std::string_view context) {
  const std::size_t n = std::max(low.size(), high.size());
  if (std::min(low.size(), high.size()) > 1 && low.size() != high.size()) {
    throw ValueError(fmt::format("{}: low has {}, but high has {}", context,
                                 counted(low.size(), "value"), high.size()));
  }
  for (int i = 0; i < static_cast<int>(n); ++i) {
    if (component(low, i) > component(high, i)) {
      throw ValueError(fmt::format("{}: low {} is above high {}", context, component(low, i),
                                   component(high, i)));
    }
  }
}

void check_components(const PerComponent& values, const char* name, const EffectInit& init) {
  if (values.size() != 1 && static_cast<int>(values.size()) != init.size) {
    throw ValueError(fmt::format("{}: {} has {}: must be 1, or {} like the row", init.context, name,
                                 counted(values.size(), "value"), init.size));
  }
}

void check_numeric(const EffectInit& init) {
  if (init.dtype == DType::kFloat32 || init.dtype == DType::kFloat64) return;
  throw ValueError(fmt::format("{}: needs float32 or float64 values; the row has {}", init.context,
                               dtype_name(init.dtype)));
}

}  // namespace mjsense::effects
