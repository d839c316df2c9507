// SPDX-License-Identifier: Apache-2.0
#pragma once
// Prints a message for users on stderr. If it cannot be written, because the terminal is gone or
// the disk is full, the program must continue; fmt::print() would throw.

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

#include "mjsense/core/files/regular_file.h"

namespace mjsense {

// As it is, terminal controls included.
inline void print_stderr_raw(std::string_view text) {
  static_cast<void>(std::fwrite(text.data(), 1, text.size(), stderr));
}

// Names in the text may come from files of others: see printable().
template <class... Args>
void print_stderr(fmt::format_string<Args...> form, Args&&... args) {
  print_stderr_raw(printable_lines(fmt::format(form, std::forward<Args>(args)...)));
}

}  // namespace mjsense
