// SPDX-License-Identifier: Apache-2.0
#pragma once
// A child of fork() has a copy of everything and none of the threads: who waits for one of them
// waits for ever. So what has threads is used in the process that made it, and nowhere destroyed
// but there.

#include <unistd.h>

#include <memory>
#include <string>
#include <utility>

#include "mjsense/core/error.h"

namespace mjsense::python {

class Birthplace {
 public:
  bool here() const { return getpid() == pid_; }
  // Throws in a child of fork(). `what`: "simulation".
  void check(const char* what) const {
    if (here()) return;
    throw RuntimeError(std::string(what) + ": this process (" + std::to_string(getpid()) +
                       ") was forked from the one that made it (" + std::to_string(pid_) +
                       "), and its threads stayed there; make it after the fork, or start "
                       "processes with 'spawn' or 'forkserver'");
  }

 private:
  pid_t pid_ = getpid();
};

// As std::make_shared, but for a copy in another process, which is left alone.
template <class T, class... Args>
std::shared_ptr<T> make_shared_here(Args&&... args) {
  return {new T(std::forward<Args>(args)...), [place = Birthplace()](T* object) {
            if (place.here()) delete object;
          }};
}

}  // namespace mjsense::python
