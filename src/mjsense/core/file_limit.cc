// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/file_limit.h"

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

FileLimitIsError::FileLimitIsError() {
  const sigset_t limit = only_the_limit();
  pthread_sigmask(SIG_BLOCK, &limit, &before_);
  ours_ = sigismember(&before_, SIGXFSZ) == 0;
}

FileLimitIsError::~FileLimitIsError() {
  if (!ours_) return;
  const int error = errno;  // somebody may be about to report it
  const sigset_t limit = only_the_limit();
  const timespec now = {};
  // What waits was sent by a write of ours: it was the error.
  while (sigtimedwait(&limit, nullptr, &now) > 0) {
  }
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  errno = error;
}

}  // namespace mjsense
