// SPDX-License-Identifier: Apache-2.0
#pragma once
// The `mjsense` program as a function, which the executable and the command of the Python package
// both call.

#include <span>
#include <string>

namespace mjsense::app {

// A command that the caller of run_program() runs itself. The program lists it.
struct OtherCommand {
  std::string name, description;
};

// Exit codes: 0 done; 1 some episodes or checks failed; 2 wrong usage or input. Errors are printed
// on stderr. An unknown command may replace this process (external_commands.h).
int run_program(int argc, char** argv, std::span<const OtherCommand> others = {});

}  // namespace mjsense::app
