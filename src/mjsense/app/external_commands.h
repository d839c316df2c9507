// SPDX-License-Identifier: Apache-2.0
#pragma once
// Unknown commands run the program `mjsense-<command>` from PATH, as in git.

#include <span>
#include <string>
#include <string_view>

namespace mjsense::app {

// Replaces this process. If there is no such program, throws KeyError with the nearest names among
// `known` and the programs in PATH, or `hint` if none is near.
[[noreturn]] void run_external(const std::string& word, char** arguments,
                               std::span<const std::string> known, std::string_view hint);

}  // namespace mjsense::app
