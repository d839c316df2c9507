// SPDX-License-Identifier: Apache-2.0
#pragma once
// Prints a message for users on stderr. If it cannot be written, because the terminal is gone or
// the disk is full, the program must continue; fmt::print() would throw.

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

namespace mjsense {

template <class... Args>
void say(fmt::format_string<Args...> form, Args&&... args) {
  const std::string text = fmt::format(form, std::forward<Args>(args)...);
  static_cast<void>(std::fwrite(text.data(), 1, text.size(), stderr));
}

}  // namespace mjsense
