// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/fields/config_checks.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"

namespace mjsense {

void require(bool good, std::string_view context, std::string_view field, double value,
             std::string_view expected) {
  if (!good)
    throw ValueError(fmt::format("{}: {} is {}: must be {}", context, field, value, expected));
}

std::string sensor_context(std::string_view name) {
  if (name.empty()) throw ValueError("sensor '': a sensor needs a name");
  return fmt::format("sensor '{}'", name);
}

}  // namespace mjsense
