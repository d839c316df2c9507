// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/durable.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <span>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/file_limit.h"
#include "mjsense/core/os.h"
#include "mjsense/core/plain_file.h"

namespace fs = std::filesystem;

namespace mjsense {

void throw_file(const char* deed, const fs::path& path, int error) {
  throw RuntimeError(fmt::format("cannot {} '{}': {}", deed, path.string(), std::strerror(error)));
}

void sync_file(const fs::path& path) {
  const Fd fd(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd || fsync(fd.get()) != 0) throw_file("sync", path, errno);
}

void rename_file(const fs::path& from, const fs::path& to) {
  if (std::rename(from.c_str(), to.c_str()) != 0) throw_file("write", to, errno);
}

void write_whole(const fs::path& path, std::string_view text) {
  const FileLimitIsError limit;
  const fs::path part = path.string() + ".part";
  unlink(part.c_str());
  {
    const Fd fd(open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644));
    if (!fd || !write_all(fd, std::as_bytes(std::span(text))) || fsync(fd.get()) != 0) {
      const int error = errno;
      unlink(part.c_str());
      throw_file("write", path, error);
    }
  }
  rename_file(part, path);
}

void copy_file(const Fd& from, const fs::path& to) {
  const FileLimitIsError limit;
  unlink(to.c_str());
  struct stat about = {};
  if (fstat(from.get(), &about) != 0) throw_file("read what is copied to", to, errno);
  const Fd file(open(to.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (!file || fchmod(file.get(), about.st_mode & 0777) != 0) throw_file("write", to, errno);
  std::vector<std::byte> piece(1 << 20);
  for (off_t at = 0;;) {
    const ssize_t n = pread(from.get(), piece.data(), piece.size(), at);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw_file("read what is copied to", to, errno);
    if (n == 0) break;
    if (!write_all(file, std::span(piece).first(static_cast<std::size_t>(n))))
      throw_file("write", to, errno);
    at += n;
  }
}

void reserve_space(const fs::path& path, std::int64_t bytes) {
  const Fd file(open(path.c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC));
  if (!file) throw_file("write", path, errno);
  rlimit limit{};
  if (getrlimit(RLIMIT_FSIZE, &limit) == 0 && limit.rlim_cur < static_cast<rlim_t>(bytes))
    throw_file("write", path, EFBIG);
  if (os::reserve(file.get(), bytes)) return;
  if (errno == ENOSPC || errno == EDQUOT || errno == EFBIG) throw_file("write", path, errno);
  // Where space cannot be reserved (some network file systems), at least ask how much there is.
  std::error_code error;
  const fs::space_info space = fs::space(path, error);
  if (!error && space.available < static_cast<std::uintmax_t>(bytes))
    throw_file("write", path, ENOSPC);
}

}  // namespace mjsense
