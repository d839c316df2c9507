// SPDX-License-Identifier: Apache-2.0
#pragma once
// Columns of text, as wide as their longest cell.

#include <string>
#include <vector>

namespace mjsense {

struct Table {
  std::vector<std::string> header;
  std::string right;  // per column: 'r' numbers stand at the right, else left
  std::vector<std::vector<std::string>> rows;
  std::string text() const;
};

// A folder's files below it, as `tree` shows them, each with its size; at most `most` entries a
// folder.
std::string tree_text(const std::string& folder, std::size_t most = 40);

}  // namespace mjsense
