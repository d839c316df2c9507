// SPDX-License-Identifier: Apache-2.0
#pragma once
// Starts other programs from a multi-threaded process. The programs inherit no descriptors and
// receive only signals that this process sends to them. A program and the processes that it has
// started end together, and of its stderr only the end is kept.

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "mjsense/core/files/file_descriptor.h"
#include "mjsense/record/spawn.h"

namespace mjsense::record {

struct Child {
  pid_t pid = -1;
  Fd in;              // write end of its stdin, non-blocking; empty if it has no input
  Fd out;             // read end of its stdout; empty unless requested
  Fd log;             // read end of its stderr, non-blocking; empty once all writers have closed it
  std::string words;  // the last bytes that read_log() has read from there
  SystemLimits limits;
};

// Starts argv[0] (searched in PATH). The child leads a new process group, so that Ctrl-C in the
// terminal reaches only this process, which then decides what to do with the child. If this process
// is killed, the child reads the end of its input and exits. `folder`: open directory used as its
// working directory; -1: the current one. Throws RuntimeError if the program cannot be started.
Child start_process(const std::vector<std::string>& argv, bool pipe_in, bool pipe_out,
                    int folder = -1, const SystemLimits& limits = {});
// The same with an open file as stdin. The file's position shows how much the child has read.
Child start_process(const std::vector<std::string>& argv, const Fd& input, int folder = -1,
                    const SystemLimits& limits = {});

// Reads what the child has written to stderr, without waiting. A child waits for this once it has
// written more than a pipe holds: call it whenever `log` is readable.
void read_log(Child& child);

struct Exit {
  bool ok = false;
  std::string why;  // "exit code 1: <last lines of stderr>", "killed by signal 9"
  double cpu_s = 0;
};

// Returns whether the child has exited; then `result` is set, and processes that it has left behind
// are killed. In a process that ignores SIGCHLD the system keeps no exit status. The child then
// counts as failed if it wrote to stderr. In either case the caller must check its output.
bool process_ended(Child& child, Exit& result);
// Sends SIGKILL to the child and to the processes that it has started, and waits for the child. Does
// not reach processes that have left the child's group (setsid).
Exit kill_process(Child& child);

// Limits of a program: time without output, amount of output, CPU time and memory.
struct ProcessLimits {
  double silence_s = 60;
  SystemLimits system;
  std::size_t max_bytes = std::size_t{1} << 30;
};

// Runs a program and returns its stdout; `stderr_tail` receives the end of its stderr. `check` is
// called at least every 0.1 s and may throw. Throws RuntimeError if the program fails or exceeds a
// limit; whatever is thrown, the program is killed.
std::string run_process(const std::vector<std::string>& argv, const ProcessLimits& limits = {},
                        std::string* stderr_tail = nullptr,
                        const std::function<void()>& check = {});

// ffmpeg program: `wanted`, otherwise $MJSENSE_FFMPEG, otherwise "ffmpeg".
std::string ffmpeg_program(const std::string& wanted);

}  // namespace mjsense::record
