// SPDX-License-Identifier: Apache-2.0
#pragma once
// How `mjsense --help` and `mjsense COMMAND --help` look: wrapped to the terminal's width, with
// examples.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace mjsense::app {

struct Example {
  std::string command, explanation;
};

// Applies to a program and to the subcommands that are added to it later.
void set_help_format(CLI::App& program);

// Shown below the options.
void add_examples(CLI::App& app, const std::vector<Example>& examples);

}  // namespace mjsense::app
