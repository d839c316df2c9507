// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/regular_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "mjsense/core/error.h"
#include "mjsense/core/files/file_size_limit.h"
#include "mjsense/core/text/utf8.h"

namespace mjsense {
namespace {

constexpr std::size_t kMaxNameBytes = 255;

bool is_control(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; }

const char* kind_of(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a pipe";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

// A hole in a sparse file takes no space on the disk, but takes as long to read as data. Some
// network file systems report that no blocks are allocated; they do not report holes either.
constexpr std::int64_t kFreeBytes = std::int64_t{1} << 30, kMaxOfHoles = 1000;

bool is_mostly_holes(int fd, const struct stat& about) {
  const std::int64_t size = about.st_size, stored = 512 * std::int64_t{about.st_blocks};
  if (size <= kFreeBytes || size / kMaxOfHoles <= stored) return false;
  const bool holes = lseek(fd, 0, SEEK_HOLE) < size;
  lseek(fd, 0, SEEK_SET);
  return holes;
}

// Number of bytes of the first character if it can be displayed, otherwise 0.
std::size_t character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const std::size_t size = utf8_size(text);
  if (size <= 1) return is_control(text[0]) ? 0 : size;
  if (byte(0) == 0xC2 && byte(1) < 0xA0) return 0;  // C1 controls
  // Line separators, and marks that change the direction of writing and can make a name look like
  // another one.
  if (byte(0) == 0xE2 && byte(1) == 0x80 && byte(2) >= 0xA8 && byte(2) <= 0xAE) return 0;
  if (byte(0) == 0xE2 && byte(1) == 0x81 && byte(2) >= 0xA6 && byte(2) <= 0xA9) return 0;
  return size;
}

}  // namespace

bool is_plain_name(std::string_view name) {
  return !name.empty() && name.size() <= kMaxNameBytes && name != "." && name != ".." &&
         name.find('/') == name.npos && std::none_of(name.begin(), name.end(), is_control);
}

Fd open_plain(const std::filesystem::path& folder, std::string_view name) {
  const Fd dir(open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!dir && is_plain_name(name))
    throw RuntimeError(
        fmt::format("'{}' cannot be opened: {}", printable(name), std::strerror(errno)));
  return open_plain(dir.get(), name);
}

Fd open_plain(int folder, std::string_view name) {
  const auto fail = [&](std::string_view why) {
    throw RuntimeError(fmt::format("'{}' {}", printable(name), why));
  };
  if (!is_plain_name(name)) fail("is not a plain file name without a folder");
  // Without O_NONBLOCK, opening a pipe would wait for a writer.
  Fd file(
      openat(folder, std::string(name).c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!file && errno == ELOOP) fail("is a symbolic link, which is not followed");
  if (!file && errno == ENOENT) fail("does not exist");
  if (!file) fail(fmt::format("cannot be opened: {}", std::strerror(errno)));
  struct stat about = {};
  if (fstat(file.get(), &about) != 0)
    fail(fmt::format("cannot be opened: {}", std::strerror(errno)));
  if (!S_ISREG(about.st_mode)) fail(fmt::format("is {}, expected a file", kind_of(about.st_mode)));
  if (is_mostly_holes(file.get(), about))
    fail(fmt::format("declares {} bytes but stores {}: it is not read", about.st_size,
                     512 * about.st_blocks));
  return file;
}

bool is_plain_file(const std::filesystem::path& path) {
  struct stat about = {};
  return lstat(path.c_str(), &about) == 0 && S_ISREG(about.st_mode);
}

bool is_plain_folder(const std::filesystem::path& path) {
  struct stat about = {};
  return lstat(path.c_str(), &about) == 0 && S_ISDIR(about.st_mode);
}

std::string read_text_file(const std::string& path) {
  constexpr std::int64_t kMaxBytes = 1 << 24;
  const auto fail = [&](std::string_view why) {
    throw ValueError(fmt::format("{}: {}", printable(path), why));
  };
  // The system would end the name at a NUL.
  const bool name = path.find('\0') == path.npos;
  const Fd file(name ? open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC) : -1);
  if (!name || (!file && (errno == ENOENT || errno == ENOTDIR))) fail("no such file");
  struct stat about = {};
  if (!file || fstat(file.get(), &about) != 0)
    fail(fmt::format("cannot be opened: {}", std::strerror(errno)));
  if (!S_ISREG(about.st_mode)) fail(fmt::format("is {}, expected a file", kind_of(about.st_mode)));
  std::string text;
  char piece[1 << 14];
  while (const ssize_t n = read(file.get(), piece, sizeof piece)) {
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(fmt::format("cannot be read: {}", std::strerror(errno)));
    text.append(piece, static_cast<std::size_t>(n));
    if (static_cast<std::int64_t>(text.size()) > kMaxBytes)
      fail(fmt::format("has more than {} MiB", kMaxBytes >> 20));
  }
  return text;
}

std::int64_t size_of(const Fd& file) {
  struct stat about = {};
  return fstat(file.get(), &about) == 0 ? static_cast<std::int64_t>(about.st_size) : 0;
}

namespace {

FileState state_of(bool known, const struct stat& about) {
  if (!known) return {};
  return {about.st_dev, about.st_ino, about.st_size, about.st_mtim.tv_sec, about.st_mtim.tv_nsec};
}

}  // namespace

FileState state_of(const Fd& file) {
  struct stat about = {};
  return state_of(fstat(file.get(), &about) == 0, about);
}

FileState state_of(const std::filesystem::path& path) {
  struct stat about = {};
  return state_of(lstat(path.c_str(), &about) == 0, about);
}

bool write_all(const Fd& file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = write(file.get(), bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n == 0) errno = ENOSPC;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

void write_file(const std::filesystem::path& path,
                std::initializer_list<std::span<const std::byte>> pieces) {
  const FileLimitGuard limit;
  // A unique temporary name, because other threads or processes may be writing the same file.
  static std::atomic<unsigned> calls = 0;
  const std::string part = fmt::format("{}.{}-{}.part", path.string(), getpid(), ++calls);
  const auto fail = [&] {
    const int error = errno;
    unlink(part.c_str());
    throw RuntimeError(fmt::format("cannot write '{}': {}", path.string(), std::strerror(error)));
  };
  // left by an earlier process with the same id, or a link planted by someone else
  unlink(part.c_str());
  Fd file(open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644));
  if (!file) fail();
  for (const std::span<const std::byte> piece : pieces) {
    if (!write_all(file, piece)) fail();
  }
  if (close(file.release()) != 0 || rename(part.c_str(), path.c_str()) != 0) fail();
}

std::string printable(std::string_view text) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t size = character(text.substr(at));
    out += size == 0 ? std::string_view("?") : text.substr(at, size);
    at += std::max<std::size_t>(1, size);
  }
  return out;
}

std::string printable_lines(std::string_view text) {
  std::string out;
  while (true) {
    const std::size_t end = text.find('\n');
    out += printable(text.substr(0, end));
    if (end == std::string_view::npos) return out;
    out += '\n';
    text.remove_prefix(end + 1);
  }
}

}  // namespace mjsense
