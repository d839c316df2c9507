// SPDX-License-Identifier: Apache-2.0
#pragma once
// Handling of the limit on file sizes (ulimit -f). By default a write beyond it raises SIGXFSZ,
// which kills the program in the middle of a file. If the signal is ignored or blocked, the write
// fails with EFBIG instead, as on a full disk.

#include <csignal>

namespace mjsense {

// RAII guard: during its lifetime, a write of this thread beyond the limit is an error instead of a
// signal. The signal handlers of the process are unchanged. Guards may be nested.
class FileLimitGuard {
 public:
  FileLimitGuard();
  ~FileLimitGuard();
  FileLimitGuard(const FileLimitGuard&) = delete;
  FileLimitGuard& operator=(const FileLimitGuard&) = delete;

 private:
  sigset_t before_;
  bool ours_;  // the signal was not blocked before
};

}  // namespace mjsense
