// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/embedded_files.h"

#include <algorithm>
#include <string>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense {

std::string_view embedded_file(std::string_view name) {
  const std::span<const EmbeddedFile> files = embedded_files();
  const auto found = std::ranges::find(files, name, &EmbeddedFile::name);
  if (found != files.end()) return found->text;
  // The message lists files of the same folder, if there are any.
  const std::string_view folder = name.substr(0, name.find('/') + 1);
  std::vector<std::string> near, all;
  for (const EmbeddedFile& file : files) {
    all.emplace_back(file.name);
    if (!folder.empty() && file.name.starts_with(folder)) near.emplace_back(file.name);
  }
  throw_unknown("models", "embedded file", name, near.empty() ? all : near);
}

}  // namespace mjsense
