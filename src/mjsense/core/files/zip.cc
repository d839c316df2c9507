// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/zip.h"

#include <fmt/format.h>

#include <limits>
#include <span>

#include "mjsense/core/error.h"
#include "mjsense/core/files/deflate.h"

namespace mjsense {
namespace {

constexpr std::uint32_t kLocalHeader = 0x04034b50, kDirectoryHeader = 0x02014b50,
                        kDirectoryEnd = 0x06054b50;
constexpr std::uint16_t kVersion = 20;               // 2.0: deflate
constexpr std::uint16_t kUtf8 = 1 << 11;             // flag: names are UTF-8
constexpr std::uint16_t kDeflate = 8;                // method
constexpr int kLevel = 6;                            // of compression
constexpr std::uint16_t kDate = 1 << 5 | 1;          // 1 January 1980, the format's first day
constexpr std::uint32_t kReadable = 0100644u << 16;  // a regular file, rw-r--r--

// Integers of the format are little-endian.
void put16(std::string& out, std::uint32_t x) {
  out += static_cast<char>(x & 0xff);
  out += static_cast<char>(x >> 8 & 0xff);
}
void put32(std::string& out, std::uint32_t x) {
  put16(out, x & 0xffff);
  put16(out, x >> 16);
}

}  // namespace

void ZipWriter::require_room(std::size_t bytes) const {
  if (files_.size() + directory_.size() + bytes > std::numeric_limits<std::uint32_t>::max() ||
      count_ == std::numeric_limits<std::uint16_t>::max())
    throw ValueError("the files do not fit into a zip archive: at most 65,535 files and 4 GiB");
}

void ZipWriter::add(std::string_view name, std::string_view bytes) {
  if (name.empty() || name.size() > std::numeric_limits<std::uint16_t>::max())
    throw ValueError(
        fmt::format("zip archive: a name of {} bytes, expected 1 to 65535", name.size()));
  require_room(bytes.size());
  const std::span plain(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  const auto packed = deflated(plain, kLevel, DeflateFormat::kRaw);
  require_room(packed.size() + 2 * name.size() + 128);
  const auto offset = static_cast<std::uint32_t>(files_.size());
  const std::uint32_t crc = crc32_of(0, bytes.data(), bytes.size());
  const auto put_common = [&](std::string& out) {
    put16(out, kVersion);
    put16(out, kUtf8);
    put16(out, kDeflate);
    put16(out, 0);  // time
    put16(out, kDate);
    put32(out, crc);
    put32(out, static_cast<std::uint32_t>(packed.size()));
    put32(out, static_cast<std::uint32_t>(bytes.size()));
    put16(out, static_cast<std::uint32_t>(name.size()));
    put16(out, 0);  // extra field
  };
  put32(files_, kLocalHeader);
  put_common(files_);
  files_ += name;
  files_.append(packed.begin(), packed.end());

  put32(directory_, kDirectoryHeader);
  put16(directory_, 3 << 8 | kVersion);  // made by: Unix
  put_common(directory_);
  put16(directory_, 0);  // comment
  put16(directory_, 0);  // disk
  put16(directory_, 0);  // internal attributes
  put32(directory_, kReadable);
  put32(directory_, offset);
  directory_ += name;
  ++count_;
}

std::string ZipWriter::finish() {
  const auto at = static_cast<std::uint32_t>(files_.size());
  std::string out = std::move(files_);
  out += directory_;
  put32(out, kDirectoryEnd);
  put32(out, 0);  // disks
  put16(out, count_);
  put16(out, count_);
  put32(out, static_cast<std::uint32_t>(directory_.size()));
  put32(out, at);
  put16(out, 0);  // comment
  return out;
}

}  // namespace mjsense
