// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/checksum.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <span>

#include "mjsense/core/error.h"
#include "mjsense/core/files/deflate.h"
#include "mjsense/core/files/file_descriptor.h"
#include "mjsense/core/files/file_size_limit.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/record/folder.h"
#include "mjsense/record/sha256.h"

namespace mjsense::record {
namespace {

constexpr std::size_t kPieceBytes = 1 << 15;  // fits in a core's L1 cache

std::string seal_text(const std::string& crc, std::int64_t bytes) {
  return fmt::format("\nmjsense: crc32 {} of the {:>16} bytes above\n", crc, bytes);
}

// Sum of the first `bytes` of a file, or of all of it if it is shorter.
template <class Sum>
std::string sum_of(int fd, std::int64_t bytes) {
  Sum sum;
  std::array<std::uint8_t, kPieceBytes> piece;
  for (std::int64_t at = 0; at < bytes;) {
    const std::int64_t maximum = std::min<std::int64_t>(kPieceBytes, bytes - at);
    const ssize_t n = pread(fd, piece.data(), static_cast<std::size_t>(maximum), at);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw RuntimeError(fmt::format("cannot be read: {}", std::strerror(errno)));
    if (n == 0) break;
    sum.add(piece.data(), static_cast<std::size_t>(n));
    at += n;
  }
  return sum.text();
}

std::int64_t file_size(int fd) {
  struct stat about = {};
  return fstat(fd, &about) == 0 ? static_cast<std::int64_t>(about.st_size) : 0;
}

}  // namespace

void Checksum::add(const void* bytes, std::size_t count) { crc_ = crc32_of(crc_, bytes, count); }

std::string Checksum::text() const { return fmt::format("{:08x}", crc_); }

std::string checksum_of(int fd) { return sum_of<Checksum>(fd, file_size(fd)); }

std::string sha256_of(int fd) { return sum_of<Sha256>(fd, file_size(fd)); }

void seal_file(const Folder& folder, const std::string& name) {
  const FileLimitGuard limit;
  const Fd file(openat(folder.fd(), name.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW));
  const auto fail = [&] { throw_file("write", folder.display_path(name), errno); };
  if (!file) fail();
  const std::int64_t size = file_size(file.get());
  const std::string seal = seal_text(sum_of<Checksum>(file.get(), size), size);
  if (lseek(file.get(), size, SEEK_SET) != size || !write_all(file, std::as_bytes(std::span(seal))))
    fail();
}

Seal check_seal(int fd) {
  const std::string form = seal_text("00000000", 0);
  const std::int64_t end = file_size(fd) - static_cast<std::int64_t>(form.size());
  if (end < 0) return Seal::kNone;
  std::string found(form.size(), '\0');
  if (pread(fd, found.data(), found.size(), end) != static_cast<ssize_t>(found.size()))
    return Seal::kNone;
  if (found == seal_text(sum_of<Checksum>(fd, end), end)) return Seal::kValid;
  // The line itself may be damaged. It counts as a checksum line if more than half of its fixed
  // characters match.
  std::size_t same = 0, fixed = 0;
  for (std::size_t i = 0; i < form.size(); ++i) {
    if (form[i] == '0') continue;
    ++fixed;
    same += found[i] == form[i];
  }
  return 2 * same > fixed ? Seal::kCorrupt : Seal::kNone;
}

}  // namespace mjsense::record
