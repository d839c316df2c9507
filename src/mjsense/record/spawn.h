// SPDX-License-Identifier: Apache-2.0
#pragma once
// The start of another program. posix_spawn() does all of it but one thing: a signal that was sent
// to our whole process group (Ctrl-C, a job's end) while the child still belonged to it would reach
// the program as soon as it runs.

#include <sys/types.h>

#include <string>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense {

// There is no such program, or it is none that this machine runs.
struct CannotStart : RuntimeError {
  using RuntimeError::RuntimeError;
};

// Starts argv[0], found on PATH, with these descriptors as stdin, stdout and stderr and no other.
// It leads its own process group and gets no signal that was sent to ours, not even one sent before
// it ran; its signals have their default meaning. `folder`: an open directory in which it runs; -1:
// ours. Throws CannotStart.
pid_t spawn(const std::vector<std::string>& argv, int in, int out, int log, int folder = -1);

}  // namespace mjsense
