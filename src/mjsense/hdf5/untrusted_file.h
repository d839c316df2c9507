// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reading HDF5 files that are untrusted or damaged. Nothing outside the file is accessed, nothing
// is read before its type, shape and size are checked, and the work is bounded by the size of the
// file. in_child() contains failures of the library itself in a separate process.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/hdf5/h5.h"

namespace mjsense::hdf5 {

inline constexpr int kMaxDepth = 32;               // maximum depth of nested groups
inline constexpr std::size_t kMaxNames = 100'000;  // maximum number of names in a group or file
inline constexpr std::size_t kMaxTextBytes = std::size_t{1} << 24;  // maximum size of a text
// Maximum size of a row or a chunk.
inline constexpr std::uint64_t kMaxRowBytes = std::uint64_t{1} << 26;

// True for rows that are more than 1 GiB and 200 times the size of their file: a decompression bomb.
inline bool is_bomb(std::uint64_t unpacked_bytes, std::uint64_t file_bytes) {
  return unpacked_bytes > (std::uint64_t{1} << 30) + 200 * file_bytes;
}

// Throws RuntimeError "'name' why".
[[noreturn]] void refuse(const std::string& name, std::string_view why);

// Opens `path` link by link. Only hard links are followed. Throws RuntimeError for a soft or
// external link, which it names, and for an object of another kind.
[[nodiscard]] Id open_group(hid_t parent, const std::string& path);
[[nodiscard]] Id open_dataset(hid_t parent, const std::string& path);

// Returns the size of the dataset's elements in bytes, in the file's type. Throws RuntimeError if
// the data is in other files, if rows or chunks are larger than kMaxRowBytes, or if the size is
// far larger than the stored data can hold. Call check_chunks() before reading the data.
std::uint64_t check_storage(hid_t dataset, const std::string& name);

// Calls visit("obs/agent/qpos") for every dataset below `group`, sorted. Throws RuntimeError if
// groups form a cycle, or if kMaxDepth or kMaxNames is exceeded.
void each_dataset(hid_t group, const std::function<void(const std::string& path)>& visit);

// Reads a dataset of single bytes [n], n <= most.
[[nodiscard]] std::string read_bytes(hid_t parent, const std::string& path, std::size_t maximum);

// The process that read a file was killed by another process or got no processor time, so it
// is unknown whether the file is damaged.
struct ReaderInterrupted : RuntimeError {
  using RuntimeError::RuntimeError;
};

// Runs `read` in a child process and returns its result. A crash, a hang or excessive memory use of
// the child becomes a RuntimeError "what: ..."; an exception in the child is rethrown as a
// RuntimeError with the same message. The limit on processor time depends on `file_bytes`: 20 s for
// small files. The limit on elapsed time is thirty times that, or `timeout_s`; if only this one is
// exceeded, ReaderInterrupted is thrown. The child may use 1 GiB more memory than this process. It
// does not receive signals that are sent to this process's group, and inherits no open file but
// `file`.
[[nodiscard]] std::string in_child(std::string_view what, std::uint64_t file_bytes,
                                   const std::function<std::string()>& read,
                                   std::uint64_t timeout_s = 0, int file = -1);

}  // namespace mjsense::hdf5
