// SPDX-License-Identifier: Apache-2.0
#pragma once
// Words that the program does not know run `mjsense-<word>` from PATH, as git does.

#include <span>
#include <string>

namespace mjsense {

// Replaces this process; throws KeyError with the nearest of `known` and of the programs in PATH if
// there is none.
[[noreturn]] void run_external(const std::string& word, char** arguments,
                               std::span<const std::string> known);

}  // namespace mjsense
