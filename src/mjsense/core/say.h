// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a person may read on stderr. One that cannot be written, because its terminal is gone or its
// disk is full, is no reason to end: fmt::print() would throw.

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
