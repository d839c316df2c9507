// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/embedded_files.h"

#include <string>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense {

std::string_view embedded_file(std::string_view name) {
  std::vector<std::string> names;
  for (const EmbeddedFile& file : embedded_files()) {
    if (file.name == name) return file.text;
    names.emplace_back(file.name);
  }
  throw_unknown("models", "embedded file", name, names);
}

}  // namespace mjsense
