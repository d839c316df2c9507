// SPDX-License-Identifier: Apache-2.0
#pragma once
// Completion of commands, options and names in bash, zsh and fish. The shells run
// `mjsense complete WORD...`, so what they offer is always what this program accepts.

#include <CLI/CLI.hpp>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace mjsense {

// The values of an option ("--robot") or of a positional ("task"). Options without an entry take
// anything: the shell completes file names.
using Choices = std::map<std::string, std::vector<std::string>>;

// The script that a shell sources. Throws ValueError for another shell than bash, zsh and fish.
std::string completion_script(const std::string& shell);

// What the last of `words` (those after "mjsense", the last one possibly empty) can become.
std::vector<std::string> complete(const CLI::App& program, const Choices& choices,
                                  std::span<const std::string> words);

}  // namespace mjsense
