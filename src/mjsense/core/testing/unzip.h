// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads the archives of core/files/zip.h, by their directory.

#include <zlib.h>

#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>

namespace mjsense {

// Name -> bytes of every file. Throws for a wrong structure or checksum.
inline std::map<std::string, std::string> unzip(const std::string& archive) {
  const auto number = [&](std::size_t at, int bytes) {
    std::uint32_t x = 0;
    for (int i = bytes; i-- > 0;) x = x << 8 | static_cast<std::uint8_t>(archive.at(at + i));
    return x;
  };
  const auto expect = [](bool ok, const char* what) {
    if (!ok) throw std::runtime_error(what);
  };
  const std::size_t end = archive.size() - 22;  // of the directory; no comment follows
  expect(number(end, 4) == 0x06054b50, "no end of the directory");
  expect(number(end + 12, 4) + number(end + 16, 4) == end, "wrong size of the directory");
  std::map<std::string, std::string> files;
  std::size_t at = number(end + 16, 4);
  for (std::uint32_t i = 0; i < number(end + 10, 2); ++i) {
    expect(number(at, 4) == 0x02014b50, "no entry of the directory");
    const std::uint32_t crc = number(at + 16, 4), packed = number(at + 20, 4),
                        name_size = number(at + 28, 2), local = number(at + 42, 4);
    expect(number(local, 4) == 0x04034b50 && number(local + 14, 4) == crc, "wrong local header");
    const std::string name = archive.substr(at + 46, name_size);
    expect(archive.substr(local + 30, name_size) == name, "wrong local name");
    std::string bytes(number(at + 24, 4), '\0');
    z_stream z{};
    inflateInit2(&z, -MAX_WBITS);
    z.next_in =
        reinterpret_cast<Bytef*>(const_cast<char*>(archive.data() + local + 30 + name_size));
    z.avail_in = packed;
    z.next_out = reinterpret_cast<Bytef*>(bytes.data());
    z.avail_out = static_cast<uInt>(bytes.size());
    const int status = inflate(&z, Z_FINISH);
    inflateEnd(&z);
    expect(status == Z_STREAM_END && z.total_out == bytes.size(), "wrong compressed data");
    expect(crc32(0, reinterpret_cast<const Bytef*>(bytes.data()),
                 static_cast<uInt>(bytes.size())) == crc,
           "wrong checksum");
    files[name] = bytes;
    at += 46 + name_size;
  }
  expect(at == end, "the directory is longer than its entries");
  return files;
}

}  // namespace mjsense
