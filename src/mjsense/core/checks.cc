// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/checks.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

[[noreturn]] void fail(std::string_view place, std::string_view field, const std::string& value,
                       std::string_view expected) {
  throw ValueError(fmt::format("{}: {} is {}: must be {}", place, field, value, expected));
}

// Every value, or the whole list if it has more than one.
template <class T, class Good>
void require_all(std::span<const T> values, std::string_view place, std::string_view field,
                 std::string_view expected, Good&& good) {
  if (std::ranges::all_of(values, good)) return;
  fail(place, field,
       values.size() == 1 ? fmt::format("{}", values[0])
                          : fmt::format("({})", fmt::join(values, ", ")),
       expected);
}

bool not_negative(double x) { return x >= 0 && std::isfinite(x); }

}  // namespace

void require(bool good, std::string_view place, std::string_view field, double value,
             std::string_view expected) {
  if (!good) fail(place, field, fmt::format("{}", value), expected);
}

void require_finite(double value, std::string_view place, std::string_view field) {
  require(std::isfinite(value), place, field, value, "finite");
}

void require_finite(std::span<const double> values, std::string_view place,
                    std::string_view field) {
  require_all(values, place, field, "finite", [](double x) { return std::isfinite(x); });
}

void require_positive(double value, std::string_view place, std::string_view field) {
  require(value > 0 && std::isfinite(value), place, field, value, "above 0, and finite");
}

void require_not_negative(double value, std::string_view place, std::string_view field) {
  require(not_negative(value), place, field, value, "0 or more, and finite");
}

void require_not_negative(std::span<const double> values, std::string_view place,
                          std::string_view field) {
  require_all(values, place, field, "0 or more, and finite", not_negative);
}

void require_probability(double value, std::string_view place, std::string_view field) {
  require(value >= 0 && value <= 1, place, field, value, "between 0 and 1");
}

void require_color(std::span<const float> rgba, std::string_view place, std::string_view field) {
  require_all(rgba, place, field, "4 numbers between 0 and 1",
              [](float x) { return x >= 0 && x <= 1; });
}

int require_word(std::string_view value, std::span<const std::string_view> words,
                 std::string_view place, std::string_view field) {
  const auto found = std::ranges::find(words, value);
  if (found != words.end()) return static_cast<int>(found - words.begin());
  const std::vector<std::string> names(words.begin(), words.end());
  throw ValueError(fmt::format(
      "{}: {} is '{}': must be one of {}{}", place, field, value, fmt::join(words, ", "),
      nearest_names(value, names, 1).empty() ? "" : suggest(value, names)));
}

std::string sensor_place(std::string_view name) {
  if (name.empty()) throw ValueError("sensor '': a sensor needs a name");
  return fmt::format("sensor '{}'", name);
}

}  // namespace mjsense
