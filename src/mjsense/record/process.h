// SPDX-License-Identifier: Apache-2.0
#pragma once
// Starts other programs from a multi-threaded process. The programs inherit no descriptors and
// receive only signals that this process sends to them.

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/files/file_descriptor.h"

namespace mjsense::record {

struct Child {
  pid_t pid = -1;
  Fd in;   // write end of its stdin, non-blocking; empty if it has no input
  Fd out;  // read end of its stdout; empty unless requested
  Fd log;  // its stderr, in an anonymous file
};

// Starts argv[0] (searched in PATH). The child leads a new process group, so that Ctrl-C in the
// terminal reaches only this process, which then decides what to do with the child. If this process
// is killed, the child reads the end of its input and exits. `folder`: open directory used as its
// working directory; -1: the current one. Throws RuntimeError if the program cannot be started.
Child start_process(const std::vector<std::string>& argv, bool pipe_in, bool pipe_out,
                    int folder = -1);
// The same with an open file as stdin. The file's position shows how much the child has read.
Child start_process(const std::vector<std::string>& argv, const Fd& input, int folder = -1);

struct Exit {
  bool ok = false;
  std::string why;  // "exit code 1: <last lines of stderr>", "killed by signal 9"
  double cpu_s = 0;
};

// Waits for the child to exit; with `block` false, returns false if it still runs. In a process
// that ignores SIGCHLD the system keeps no exit status. The child then counts as failed if it wrote
// to stderr. In either case the caller must check its output.
bool wait_process(Child& child, bool block, Exit& result);
void kill_process(Child& child);  // sends SIGKILL and waits

// Limits of a program: time without output, amount of output, CPU time and memory.
struct ProcessLimits {
  double silence_s = 60;
  std::uint64_t cpu_s = 0, memory = 0;  // CPU time in seconds, memory in bytes; 0: unlimited
  std::size_t max_bytes = std::size_t{1} << 30;
};

// Runs a program and returns its stdout; `stderr_tail` receives the end of its stderr. Throws
// RuntimeError if it fails or exceeds a limit, in which case it is killed.
std::string run_process(const std::vector<std::string>& argv, const ProcessLimits& limits = {},
                        std::string* stderr_tail = nullptr);

// ffmpeg program: `wanted`, otherwise $MJSENSE_FFMPEG, otherwise "ffmpeg".
std::string ffmpeg_program(const std::string& wanted);

}  // namespace mjsense::record
