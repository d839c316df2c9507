// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/text_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "mjsense/app/progress.h"
#include "mjsense/app/terminal.h"
#include "mjsense/core/files/regular_file.h"

namespace mjsense::app {
namespace {

void add_tree(const std::filesystem::path& folder, const std::string& indent, std::size_t maximum,
              std::string& out) {
  std::vector<std::filesystem::directory_entry> entries;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) entries.push_back(entry);
  std::ranges::sort(entries);
  const std::size_t shown = entries.size() > maximum ? maximum - 1 : entries.size();
  for (std::size_t i = 0; i < shown; ++i) {
    const bool last = i + 1 == entries.size();
    const std::string name = entries[i].path().filename().string();
    out += fmt::format("{}{}{}", indent, last ? "└── " : "├── ", name);
    if (entries[i].is_directory()) {
      out += "/\n";
      add_tree(entries[i].path(), indent + (last ? "    " : "│   "), maximum, out);
    } else {
      out += "  " + bytes_text(static_cast<double>(entries[i].file_size())) + "\n";
    }
  }
  if (shown < entries.size())
    out += fmt::format("{}└── ... {} more\n", indent, entries.size() - shown);
}

}  // namespace

std::string Table::text() const {
  std::vector<std::size_t> widths;
  for (const std::string& cell : header) widths.push_back(display_width(cell));
  std::vector<std::vector<std::string>> shown = rows;
  for (auto& row : shown) {
    for (std::string& cell : row) cell = printable(cell);  // names from files of others
    for (std::size_t i = 0; i < row.size(); ++i)
      widths[i] = std::max(widths[i], display_width(row[i]));
  }
  std::string out;
  const auto add = [&](const std::vector<std::string>& row) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string padding(widths[i] - display_width(row[i]), ' ');
      const bool to_right = i < right.size() && right[i] == 'r';
      line += to_right ? padding + row[i] : row[i] + padding;
      if (i + 1 < row.size()) line += "  ";
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  };
  add(header);
  for (const auto& row : shown) add(row);
  return out;
}

std::string tree_text(const std::string& folder, std::size_t maximum) {
  std::string out = folder + "\n";
  add_tree(folder, "", maximum, out);
  return out;
}

}  // namespace mjsense::app
