// SPDX-License-Identifier: Apache-2.0
#pragma once
// Completion of commands, options and names in bash, zsh and fish. The shells run
// `mjsense complete WORD...`, so what they offer is always what this program accepts.

#include <CLI/CLI.hpp>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace mjsense::app {

// The values of an option ("--robot") or of a positional ("task"). Options without an entry take
// anything: the shell completes file names.
using Choices = std::map<std::string, std::vector<std::string>>;

// Returns the script that a shell sources. Throws ValueError for shells other than bash, zsh and
// fish.
std::string completion_script(const std::string& shell);

// Returns the completions of the last of `words` (those after "mjsense"; the last one may be
// empty).
std::vector<std::string> complete(const CLI::App& program, const Choices& choices,
                                  std::span<const std::string> words);

}  // namespace mjsense::app
