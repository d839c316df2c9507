// SPDX-License-Identifier: Apache-2.0
#pragma once
// The files of models/, compiled into the library (cmake/embed.py).

#include <span>
#include <string_view>

namespace mjsense {

struct EmbeddedFile {
  std::string_view name;  // path relative to models/: "robots/quadruped.xml"
  std::string_view text;
};

std::span<const EmbeddedFile> embedded_files();

// Contents of one file. Throws KeyError with the nearest names.
std::string_view embedded_file(std::string_view name);

}  // namespace mjsense
