// SPDX-License-Identifier: Apache-2.0
#pragma once
// CRC-32 as computed by zlib and Python's zlib.crc32. Data sets and videos store theirs in an
// attribute. A whole HDF5 file stores it in a text line after its end, which the HDF5 library
// ignores. A program that opens the file for writing truncates that line, so the line never
// describes an older state of the file.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace mjsense::record {

class Folder;

class Checksum {
 public:
  void add(const void* bytes, std::size_t count);
  [[nodiscard]] std::string text() const;  // for example "1a2b3c4d"

 private:
  std::uint32_t crc_ = 0;
};

// CRC-32 and SHA-256 of everything from the descriptor's start to its end. Throw RuntimeError if
// reading fails.
[[nodiscard]] std::string checksum_of(int fd);
[[nodiscard]] std::string sha256_of(int fd);

inline constexpr const char* kChecksumAttribute = "crc32";
inline constexpr const char* kBytesAttribute = "bytes";

enum class Seal { kValid, kCorrupt, kNone };

// Appends the checksum line to a closed file. Throws RuntimeError if it cannot be written.
void seal_file(const Folder& folder, const std::string& name);
// kNone: the file has no such line, for example because another program wrote it.
[[nodiscard]] Seal check_seal(int fd);

}  // namespace mjsense::record
