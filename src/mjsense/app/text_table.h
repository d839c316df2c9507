// SPDX-License-Identifier: Apache-2.0
#pragma once
// Text tables whose columns are as wide as their longest cell.

#include <string>
#include <vector>

namespace mjsense::app {

struct Table {
  std::vector<std::string> header;
  std::string right;  // per column: 'r' right-aligned (numbers), otherwise left-aligned
  std::vector<std::vector<std::string>> rows;
  std::string text() const;
};

// The files below a folder, formatted as by `tree`, each with its size; at most `maximum` entries
// per folder.
std::string tree_text(const std::string& folder, std::size_t maximum = 40);

}  // namespace mjsense::app
