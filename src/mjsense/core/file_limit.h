// SPDX-License-Identifier: Apache-2.0
#pragma once
// The limit on the size of files (ulimit -f). Who writes beyond it gets a signal that ends the
// program in the middle of a file, unless the signal is ignored or blocked: then the write fails
// with EFBIG, as on a full disk.

#include <csignal>

namespace mjsense {

// While it lives, a write of this thread beyond the limit is an error and no signal; what the
// process does with signals stays as it is. May be nested.
class FileLimitIsError {
 public:
  FileLimitIsError();
  ~FileLimitIsError();
  FileLimitIsError(const FileLimitIsError&) = delete;
  FileLimitIsError& operator=(const FileLimitIsError&) = delete;

 private:
  sigset_t before_;
  bool ours_;  // it was not blocked before
};

}  // namespace mjsense
