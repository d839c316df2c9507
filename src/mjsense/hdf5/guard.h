// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reading HDF5 files that somebody else made, or that are damaged: nothing outside the file is
// reached, nothing is read before its type, shape and size are known, and work is bounded by the
// size of the file. What the library itself does with a broken file stays in a process of its own.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/hdf5/h5.h"

namespace mjsense::h5 {

inline constexpr int kMostDepth = 32;                                // groups inside groups
inline constexpr std::size_t kMostNames = 100'000;                   // of one group, or of one file
inline constexpr std::size_t kMostTextBytes = std::size_t{1} << 24;  // of one text
inline constexpr std::uint64_t kMostRowBytes = std::uint64_t{1} << 26;  // of one row or one chunk

// Opens `path` link by link. Only hard links are followed: soft and external ones are a
// RuntimeError that names them, and so is what is of another kind.
[[nodiscard]] Id open_group(hid_t parent, const std::string& path);
[[nodiscard]] Id open_dataset(hid_t parent, const std::string& path);

// Bytes of a dataset's elements as the file's type has them. Throws RuntimeError when it lies in
// other files, when its rows or chunks are larger than kMostRowBytes, or when it claims far more than what
// is stored can hold. What is read then goes through check_chunks() first.
std::uint64_t check_storage(hid_t dataset, const std::string& name);

// Calls visit("obs/agent/qpos") for every dataset below `group`, sorted. Throws RuntimeError where
// groups form a cycle, or beyond kMostDepth and kMostNames.
void each_dataset(hid_t group, const std::function<void(const std::string& path)>& visit);

// A dataset of single bytes [n], n <= most.
[[nodiscard]] std::string read_bytes(hid_t parent, const std::string& path, std::size_t most);

// Somebody ended the process that read a file, or nobody let it run, which says nothing about the
// file.
struct Ended : RuntimeError {
  using RuntimeError::RuntimeError;
};

// Runs `read` in a child process, whose crash, hang or hunger becomes a RuntimeError "what: ...";
// an exception there becomes one with its words here. `file_bytes` decides how much time it gets:
// 20 s of the processor for small files, and thirty times as much of the clock (or `patience_s`): when
// only that is over it is Ended. The child has 1 GiB beyond what this process holds, and hears no
// signal that is sent to our process group. Of our open files it has `file` alone.
[[nodiscard]] std::string in_child(std::string_view what, std::uint64_t file_bytes,
                                   const std::function<std::string()>& read,
                                   std::uint64_t patience_s = 0, int file = -1);

}  // namespace mjsense::h5
