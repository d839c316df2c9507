// SPDX-License-Identifier: Apache-2.0
#pragma once
// CRC-32 as zlib and Python's zlib.crc32 compute it: of datasets and videos as attributes, and of a
// whole HDF5 file as a line behind its end, where the HDF5 library does not look. A program that
// opens the file for writing cuts that line off, so it never speaks of an older state.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace mjsense {

class Folder;

class Checksum {
 public:
  void add(const void* bytes, std::size_t count);
  [[nodiscard]] std::string text() const;  // "1a2b3c4d"

 private:
  std::uint32_t crc_ = 0;
};

// Of everything that can still be read from a descriptor's beginning. Throws RuntimeError when
// reading fails.
[[nodiscard]] std::string checksum_of(int fd);

inline constexpr const char* kChecksumAttribute = "crc32";
inline constexpr const char* kBytesAttribute = "bytes";

enum class Seal { kWhole, kBroken, kNone };

// Appends the line to a closed file. Throws RuntimeError when the disk refuses.
void seal_file(const Folder& folder, const std::string& name);
// kNone: no such line, as in files of others.
[[nodiscard]] Seal check_seal(int fd);

}  // namespace mjsense
