// SPDX-License-Identifier: Apache-2.0
#pragma once
// Numbers of things in messages.

#include <fmt/format.h>

#include <concepts>
#include <string>
#include <string_view>

namespace mjsense {

// "1 episode", "2 episodes"; "2 successes".
[[nodiscard]] std::string counted(std::integral auto count, std::string_view noun) {
  const char* ending = count == 1 ? "" : noun.ends_with('s') ? "es" : "s";
  return fmt::format("{} {}{}", count, noun, ending);
}

}  // namespace mjsense
