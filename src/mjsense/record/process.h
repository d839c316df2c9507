// SPDX-License-Identifier: Apache-2.0
#pragma once
// Starting other programs from a process with many threads: posix_spawn, no inherited descriptors,
// no signals.

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

// A file descriptor with an owner.
class Fd {
 public:
  Fd() = default;
  explicit Fd(int fd) : fd_(fd) {}
  ~Fd() { reset(); }
  Fd(Fd&& other) noexcept : fd_(other.release()) {}
  Fd& operator=(Fd&& other) noexcept;
  Fd(const Fd&) = delete;
  Fd& operator=(const Fd&) = delete;

  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  [[nodiscard]] int release();  // the caller closes it
  void reset();

 private:
  int fd_ = -1;
};

struct Child {
  pid_t pid = -1;
  Fd in;   // write end of its stdin, non-blocking; none if it reads nothing
  Fd out;  // read end of its stdout; none unless asked for
  Fd log;  // what it writes to stderr: an anonymous file
};

// Starts argv[0] (found on PATH). The child leads its own process group, so that Ctrl-C in the
// terminal reaches only us and we decide what becomes of it; if we are killed it sees the end of
// its input and ends. Throws RuntimeError when it cannot start.
Child start_process(const std::vector<std::string>& argv, bool pipe_in, bool pipe_out);

struct Exit {
  bool ok = false;
  std::string why;  // "exit code 1: <last lines of stderr>", "killed by signal 9"
  double cpu_s = 0;
};

// Waits for the end (or, if `block` is false, returns false when it still runs).
bool wait_process(Child& child, bool block, Exit& result);
void kill_process(Child& child);  // SIGKILL, and waits

// Runs a program to its end; its whole stdout. Throws RuntimeError if it fails.
std::string run_process(const std::vector<std::string>& argv);

// Reads until `bytes` are there or the end; returns how many were read.
std::size_t read_fully(int fd, std::span<std::uint8_t> bytes);

// The ffmpeg program to use: `wanted`, else $MJSENSE_FFMPEG, else "ffmpeg".
std::string ffmpeg_program(const std::string& wanted);

}  // namespace mjsense
