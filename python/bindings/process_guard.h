// SPDX-License-Identifier: Apache-2.0
#pragma once
// Protects objects with threads against fork(). The child of fork() has a copy of the memory but
// none of the threads, so waiting for one of them never ends. Such objects may only be used and
// destroyed in the process that created them.

#include <unistd.h>

#include <memory>
#include <string>
#include <utility>

#include "mjsense/core/error.h"

namespace mjsense::python {

class ProcessGuard {
 public:
  bool is_current() const { return getpid() == pid_; }
  // Throws RuntimeError in a child of fork(). `what` names the object: "simulation".
  void check(const char* what) const {
    if (is_current()) return;
    throw RuntimeError(std::string(what) + ": this process (" + std::to_string(getpid()) +
                       ") was forked from the one that created it (" + std::to_string(pid_) +
                       "), which has its threads; create it after the fork, or start "
                       "processes with 'spawn' or 'forkserver'");
  }

 private:
  pid_t pid_ = getpid();
};

// Like std::make_shared, but the object's copy in a forked process is never destroyed.
template <class T, class... Args>
std::shared_ptr<T> make_shared_guarded(Args&&... args) {
  return {new T(std::forward<Args>(args)...), [guard = ProcessGuard()](T* object) {
            if (guard.is_current()) delete object;
          }};
}

}  // namespace mjsense::python
