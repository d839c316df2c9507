// SPDX-License-Identifier: Apache-2.0
#pragma once
// Starts another program. posix_spawn() cannot do it: it sets no resource limits, and limits that the
// parent sets afterwards (prlimit()) come when the program runs already. And a signal that was sent to the
// whole process group of this process (Ctrl-C, the end of a job) while the child still belonged to that
// group would reach the program as soon as it runs.

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense::record {

// The program does not exist or is not executable on this machine.
struct CannotStart : RuntimeError {
  using RuntimeError::RuntimeError;
};

// Limits of a program that the system enforces; 0: unlimited.
struct SystemLimits {
  std::uint64_t cpu_s = 0;   // CPU time in seconds
  std::uint64_t memory = 0;  // bytes of data: heap, stacks of threads, private mappings
};
inline constexpr int kMaxOpenFiles = 256;  // of each program

// Starts argv[0], searched in PATH, with these descriptors as stdin, stdout and stderr and no
// others. The program leads a new process group and receives no signal that was sent to this
// process' group, even one sent before it ran. Its signals have their default actions. `folder`:
// open directory used as its working directory; -1: the current one. It and the programs that it
// starts are limited by `limits` and kMaxOpenFiles, and leave no core file. Throws CannotStart.
pid_t spawn(const std::vector<std::string>& argv, int in, int out, int log, int folder = -1,
            const SystemLimits& limits = {});

}  // namespace mjsense::record
