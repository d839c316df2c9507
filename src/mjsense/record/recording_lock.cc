// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/recording_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "mjsense/core/error.h"
#include "mjsense/record/recording_folder.h"

namespace fs = std::filesystem;

namespace mjsense {
namespace {

// Who only looks holds it for a moment, and a program that is being started for another.
constexpr int kTries = 20, kPauseMicroseconds = 10'000;

// Whose lock it was may have removed it while we waited: then that name is somebody else's.
bool is_named(const Fd& lock, const fs::path& path) {
  struct stat ours = {}, named = {};
  return fstat(lock.get(), &ours) == 0 && lstat(path.c_str(), &named) == 0 &&
         ours.st_dev == named.st_dev && ours.st_ino == named.st_ino;
}

}  // namespace

Fd lock_recording(const fs::path& house, bool make) {
  const fs::path path = house / kStagingDir / kLockFile;
  const int flags = O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC | (make ? O_CREAT : 0);
  for (int n = 0; n < kTries; ++n) {
    if (n > 0) usleep(kPauseMicroseconds);
    Fd lock(open(path.c_str(), flags, 0644));
    if (!lock && !make && (errno == ENOENT || errno == ENOTDIR)) return {};
    if (!lock)
      throw RuntimeError(fmt::format("cannot write '{}': {}", path.string(), std::strerror(errno)));
    if (flock(lock.get(), LOCK_EX | LOCK_NB) == 0 && is_named(lock, path)) return lock;
  }
  throw ValueError(fmt::format("another process records into '{}'", house.string()));
}

bool is_locked(const fs::path& house) {
  const fs::path path = house / kStagingDir / kLockFile;
  const Fd lock(open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  return lock && flock(lock.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

}  // namespace mjsense
