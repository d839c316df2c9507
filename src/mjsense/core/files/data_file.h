// SPDX-License-Identifier: Apache-2.0
#pragma once
// Data files of robots, scenes and camera systems. Built-in ones are the files of models/, compiled
// into the library; user-defined ones are files on disk.

#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

struct DataFile {
  std::string path;  // on disk, or "embedded:<file>"; used in error messages
  std::string text;
};

// A kind of data file: "models/<folder>/<name><tail>" has the name <name>.
struct DataFolder {
  std::string_view kind;    // used in error messages: "scene"
  std::string_view folder;  // "scenes/"
  std::string_view tail;    // "/scene.toml"
  bool nested = false;      // names may contain folders: "libero/kitchen"

  std::vector<std::string> names() const;
  // Finds a built-in file by its name, or any file by its path, which must end in .toml and may
  // start with "embedded:". Throws KeyError with the nearest names, or ValueError if the file does
  // not exist.
  DataFile find(std::string_view name_or_path) const;
};

// Resolves `name` relative to the folder of the file at `path`, unless it is absolute, embedded or
// in a package.
std::string resolve_relative(std::string_view path, const std::string& name);

}  // namespace mjsense
