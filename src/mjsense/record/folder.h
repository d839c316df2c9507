// SPDX-License-Identifier: Apache-2.0
#pragma once
// An open directory. What is done with its entries goes through the descriptor, so it stays in this
// directory when its path is renamed, or replaced by a link to another one. No link is followed.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/fd.h"

namespace mjsense {

class Folder {
 public:
  Folder() = default;
  // Links on the way to it are followed: the path is the user's. Throws RuntimeError.
  static Folder open(const std::filesystem::path& path);
  explicit operator bool() const { return static_cast<bool>(fd_); }

  int fd() const { return fd_.get(); }
  const std::filesystem::path& path() const { return path_; }  // when it was opened: for messages
  std::string shown(const std::string& name) const { return (path_ / name).string(); }
  // A path that leads through the descriptor, for libraries that open files by path.
  std::filesystem::path reachable(const std::string& name) const;

  // The directory `name` in this one; an empty Folder where there is none. Throws ValueError for a
  // link, RuntimeError for what cannot be opened.
  Folder find(const std::string& name) const;
  Folder at(const std::string& name) const;    // RuntimeError where there is none
  Folder make(const std::string& name) const;  // a new one; RuntimeError where something is there

  bool contains(const std::string& name) const;                   // whatever it is
  bool contains(const std::string& name, const Fd& file) const;   // this very file
  bool contains(const std::string& name, const Folder& f) const;  // this very folder
  bool is_at_its_path() const;
  bool is_plain_file(const std::string& name) const;
  std::int64_t size_of(const std::string& name) const;  // bytes of a file; 0 if there is none
  std::vector<std::string> names() const;               // of its entries, sorted

  // Changes that are there after kill -9 and a power failure, or not at all. RuntimeError "cannot
  // write '...': No space left on device".
  void sync() const;
  void sync(const std::string& name) const;
  void rename(const std::string& name, const Folder& to, const std::string& new_name) const;
  void write(const std::string& name, std::string_view text) const;
  // Takes the disk space of a file before it is written: on a full disk that is a plain error, while
  // the HDF5 library may crash where it cannot write in the middle of a copy.
  void reserve_space(const std::string& name, std::int64_t bytes) const;

  // A file, or a directory with all that is in it. What cannot be removed stays.
  void remove(const std::string& name) const;
  // All that is in `inner`, then `inner` itself, if `name` is still that folder: false if not.
  bool remove(const std::string& name, const Folder& inner) const;

 private:
  Folder(Fd fd, std::filesystem::path path) : fd_(std::move(fd)), path_(std::move(path)) {}

  Fd fd_;
  std::filesystem::path path_;
};

[[noreturn]] void throw_file(std::string_view action, const std::filesystem::path& path, int error);

}  // namespace mjsense
