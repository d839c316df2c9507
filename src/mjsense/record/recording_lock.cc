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
#include "mjsense/record/recorded_house.h"

namespace fs = std::filesystem;

namespace mjsense::record {
namespace {

// Readers and programs that are being started hold the lock only for a moment.
constexpr int kTries = 20, kPauseMicroseconds = 10'000;

}  // namespace

Fd lock_recording(const Folder& house, bool make) {
  const int flags = O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC | (make ? O_CREAT : 0);
  for (int n = 0; n < kTries; ++n) {
    if (n > 0) usleep(kPauseMicroseconds);
    const Folder staging = make ? house.open_dir(kStagingDir) : house.find_dir(kStagingDir);
    if (!staging) return {};
    Fd lock(openat(staging.fd(), kLockFile, flags, 0644));
    if (!lock && !make && errno == ENOENT) return {};
    if (!lock) throw_file("write", staging.display_path(kLockFile), errno);
    // The process that held the lock may have removed the file; the name then belongs to another
    // one.
    if (flock(lock.get(), LOCK_EX | LOCK_NB) == 0 && staging.contains(kLockFile, lock)) return lock;
  }
  throw ValueError(fmt::format("another process is recording into '{}'", house.path().string()));
}

bool is_locked(const fs::path& house) {
  const fs::path path = house / kStagingDir / kLockFile;
  const Fd lock(open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  return lock && flock(lock.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

}  // namespace mjsense::record
