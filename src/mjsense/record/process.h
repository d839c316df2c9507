// SPDX-License-Identifier: Apache-2.0
#pragma once
// Starting other programs from a process with many threads: no inherited descriptors, no signals
// but those that we send.

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/fd.h"

namespace mjsense {

struct Child {
  pid_t pid = -1;
  Fd in;   // write end of its stdin, non-blocking; none if it reads nothing
  Fd out;  // read end of its stdout; none unless asked for
  Fd log;  // what it writes to stderr: an anonymous file
};

// Starts argv[0] (found on PATH). The child leads its own process group, so that Ctrl-C in the
// terminal reaches only us and we decide what becomes of it; if we are killed it sees the end of
// its input and ends. `folder`: an open directory in which it runs; -1: ours. Throws RuntimeError when
// it cannot start.
Child start_process(const std::vector<std::string>& argv, bool pipe_in, bool pipe_out,
                    int folder = -1);
// The same with an open file as its stdin: where it stands in it tells how far it has come.
Child start_process(const std::vector<std::string>& argv, const Fd& input, int folder = -1);

struct Exit {
  bool ok = false;
  std::string why;  // "exit code 1: <last lines of stderr>", "killed by signal 9"
  double cpu_s = 0;
};

// Waits for the end (or, if `block` is false, returns false when it still runs). In a process that
// ignores SIGCHLD the system keeps no exit status: a program then counts as failed if it wrote to its
// stderr, and what it has made must be checked, as it is with a status.
bool wait_process(Child& child, bool block, Exit& result);
void kill_process(Child& child);  // SIGKILL, and waits

// How long a program may say nothing, how much it may say, and what it may use.
struct Patience {
  double silence_s = 60;
  std::uint64_t cpu_s = 0, memory = 0;  // seconds of the processor, bytes; 0: as much as it likes
  std::size_t most_bytes = std::size_t{1} << 30;
};

// Runs a program to its end; its whole stdout, and the end of its stderr in `words`. Throws RuntimeError if it fails or
// goes beyond our patience; it is killed then.
std::string run_process(const std::vector<std::string>& argv, const Patience& patience = {},
                        std::string* words = nullptr);

// The ffmpeg program to use: `wanted`, else $MJSENSE_FFMPEG, else "ffmpeg".
std::string ffmpeg_program(const std::string& wanted);

}  // namespace mjsense
