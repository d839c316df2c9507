// SPDX-License-Identifier: Apache-2.0
#pragma once
// Ctrl-C and SIGTERM during a recording by the program.

#include <unistd.h>

#include <csignal>

#include "mjsense_tasks/rollout/record_job.h"

namespace mjsense::python {

// Handles the signals during its lifetime, instead of Python. The first one finishes the running
// episodes, the second discards them, the third ends the process immediately.
class StopOnSignal {
 public:
  // With false it does nothing.
  explicit StopOnSignal(bool enabled) : enabled_(enabled) {
    if (!enabled_) return;
    flag = 0;
    struct sigaction action = {};
    action.sa_handler = &handle;
    sigaction(SIGINT, &action, &old_int_);
    sigaction(SIGTERM, &action, &old_term_);
  }
  ~StopOnSignal() {
    if (!enabled_) return;
    sigaction(SIGINT, &old_int_, nullptr);
    sigaction(SIGTERM, &old_term_, nullptr);
  }
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

  static inline tasks::rollout::StopFlag flag{0};  // number of signals

 private:
  static void handle(int signal) {
    if (++flag > 2) _exit(128 + signal);
  }

  bool enabled_;
  struct sigaction old_int_ = {}, old_term_ = {};
};

}  // namespace mjsense::python
