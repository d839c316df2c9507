// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/files/file_size_limit.h"

#include <cerrno>
#include <ctime>

namespace mjsense {
namespace {

sigset_t only_the_limit() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGXFSZ);
  return set;
}

}  // namespace

FileLimitGuard::FileLimitGuard() {
  const sigset_t limit = only_the_limit();
  pthread_sigmask(SIG_BLOCK, &limit, &before_);
  ours_ = sigismember(&before_, SIGXFSZ) == 0;
}

FileLimitGuard::~FileLimitGuard() {
  if (!ours_) return;
  const int error = errno;  // a caller may still report errno
  const sigset_t limit = only_the_limit();
  const timespec now = {};
  // A pending signal was caused by a write of this thread, which has already failed with EFBIG.
  while (sigtimedwait(&limit, nullptr, &now) > 0) {
  }
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  errno = error;
}

}  // namespace mjsense
