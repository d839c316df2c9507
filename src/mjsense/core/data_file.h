// SPDX-License-Identifier: Apache-2.0
#pragma once
// Data that people name or write themselves: robots, scenes, camera systems. Ours are files of
// models/, compiled into the library; users' are files on disk.

#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

struct DataFile {
  std::string path;  // on disk, or "embedded:<file>": what errors call it
  std::string text;
};

// A kind of them: "models/<folder>/<name><tail>" is called <name>.
struct DataFolder {
  std::string_view kind;    // for messages: "scene"
  std::string_view folder;  // "scenes/"
  std::string_view tail;    // "/scene.toml"
  bool nested = false;      // names may have folders: "libero/kitchen"

  std::vector<std::string> names() const;
  // One of ours by its name, or any by its path, which ends in .toml. Throws KeyError with the
  // nearest names, ValueError for a file that there is not.
  DataFile find(std::string_view name_or_path) const;
};

// `name` as the file at `path` means it: from its own folder, unless it is absolute, embedded or in a package.
std::string beside(std::string_view path, const std::string& name);

}  // namespace mjsense
