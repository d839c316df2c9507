// SPDX-License-Identifier: Apache-2.0
#pragma once
// An open directory. All operations on its entries go through the descriptor, so they stay in this
// directory even if its path is renamed or replaced by a symbolic link. No symbolic link is
// followed.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/files/file_descriptor.h"

namespace mjsense::record {

class Folder {
 public:
  Folder() = default;
  // Opens a directory. Symbolic links in `path` are followed, because the user chose it. Throws
  // RuntimeError.
  static Folder open(const std::filesystem::path& path);
  explicit operator bool() const { return static_cast<bool>(fd_); }

  int fd() const { return fd_.get(); }
  // Path at the time of opening, for messages.
  const std::filesystem::path& path() const { return path_; }
  std::string display_path(const std::string& name) const { return (path_ / name).string(); }
  // Path that leads through the descriptor, for libraries that open files by path.
  std::filesystem::path fd_path(const std::string& name) const;

  // Opens the subdirectory `name`; the Folder is empty if there is none. Throws ValueError for a
  // symbolic link and RuntimeError for an entry that cannot be opened.
  Folder find_dir(const std::string& name) const;
  Folder open_dir(const std::string& name) const;  // throws RuntimeError if missing
  // Creates the subdirectory `name`. Throws RuntimeError if the name is taken.
  Folder make_dir(const std::string& name) const;

  bool contains(const std::string& name) const;                   // an entry of any kind
  bool contains(const std::string& name, const Fd& file) const;   // the same file (inode)
  bool contains(const std::string& name, const Folder& f) const;  // the same directory
  bool is_at_its_path() const;
  bool is_plain_file(const std::string& name) const;
  std::int64_t size_of(const std::string& name) const;  // of a file; 0 if missing
  std::vector<std::string> names() const;               // of all entries, sorted

  // Changes that survive kill -9 and a power failure completely or not at all. They throw
  // RuntimeError ("cannot write '...': No space left on device").
  void sync() const;
  void sync(const std::string& name) const;
  void rename(const std::string& name, const Folder& to, const std::string& new_name) const;
  void write(const std::string& name, std::string_view text) const;
  // Allocates the disk space of a file before it is written. A full disk is an ordinary error here,
  // whereas the HDF5 library may crash if it cannot write in the middle of a copy.
  void reserve_space(const std::string& name, std::int64_t bytes) const;

  // Removes a file or, recursively, a directory. Entries that cannot be removed stay.
  void remove(const std::string& name) const;
  // Removes the contents of `inner`, then `inner` itself if `name` is still that directory;
  // otherwise returns false.
  bool remove(const std::string& name, const Folder& inner) const;

 private:
  Folder(Fd fd, std::filesystem::path path) : fd_(std::move(fd)), path_(std::move(path)) {}

  Fd fd_;
  std::filesystem::path path_;
};

[[noreturn]] void throw_file(std::string_view action, const std::filesystem::path& path, int error);

}  // namespace mjsense::record
