// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/system/os.h"
#include "mjsense/record/spawn.h"

namespace mjsense::record {
namespace {

std::string last_words(int log) {
  constexpr off_t kMax = 600;
  const off_t size = lseek(log, 0, SEEK_END);
  if (size <= 0) return "";
  std::string text(std::min(size, kMax), '\0');
  const ssize_t n = pread(log, text.data(), text.size(), std::max<off_t>(0, size - kMax));
  text.resize(std::max<ssize_t>(0, n));
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  for (char& c : text) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  return text;
}

[[noreturn]] void throw_system(const char* what) {
  throw RuntimeError(fmt::format("{}: {}", what, std::strerror(errno)));
}

// Both ends are closed on exec. Otherwise a program that another thread starts at the same time
// would keep the write end open, and the reader would never reach the end of its input.
std::pair<Fd, Fd> make_pipe() {
  std::pair<Fd, Fd> ends = os::make_pipe();
  if (!ends.first) throw_system("cannot create a pipe");
  return ends;
}

Child start(const std::vector<std::string>& argv, bool pipe_in, bool pipe_out, int input,
            int folder) {
  Child child;
  child.log = os::memory_file("stderr");
  if (!child.log) throw_system("cannot create an anonymous file");
  Fd child_in, child_out;
  if (pipe_in) {
    std::tie(child_in, child.in) = make_pipe();
    fcntl(child.in.get(), F_SETFL, O_NONBLOCK);
    os::widen_pipe(child.in.get(), 1 << 20);  // larger pipe: fewer wake-ups per frame
  } else if (input < 0) {
    child_in = Fd(open("/dev/null", O_RDONLY | O_CLOEXEC));
  }
  if (pipe_out) {
    std::tie(child.out, child_out) = make_pipe();
  } else {
    child_out = Fd(open("/dev/null", O_WRONLY | O_CLOEXEC));
  }

  child.pid =
      spawn(argv, input >= 0 ? input : child_in.get(), child_out.get(), child.log.get(), folder);
  return child;
}

}  // namespace

Child start_process(const std::vector<std::string>& argv, bool pipe_in, bool pipe_out, int folder) {
  return start(argv, pipe_in, pipe_out, -1, folder);
}

Child start_process(const std::vector<std::string>& argv, const Fd& input, int folder) {
  return start(argv, false, false, input.get(), folder);
}

bool wait_process(Child& child, bool block, Exit& result) {
  int status = 0;
  rusage usage{};
  pid_t got;
  do {
    got = wait4(child.pid, &status, block ? 0 : WNOHANG, &usage);
  } while (got < 0 && errno == EINTR);
  if (got == 0) return false;
  child.pid = -1;
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  result.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  const std::string stderr_tail = last_words(child.log.get());
  if (got < 0) {
    result.ok = stderr_tail.empty();
    result.why =
        "its exit status is not known, because this process ignores SIGCHLD or collects all of its "
        "children (set SIGCHLD to SIG_DFL)";
  } else if (WIFSIGNALED(status)) {
    result.why =
        fmt::format("killed by signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
    if (WTERMSIG(status) == SIGXFSZ) result.why += ": ulimit -f allows no larger file";
    if (WTERMSIG(status) == SIGXCPU) result.why += ": it exceeded its CPU time limit";
  } else if (WEXITSTATUS(status) != 0) {
    result.why = fmt::format("exit code {}", WEXITSTATUS(status));
  } else {
    result.ok = true;
  }
  if (!result.ok && !stderr_tail.empty()) result.why += ": " + stderr_tail;
  return true;
}

void kill_process(Child& child) {
  if (child.pid < 0) return;
  kill(child.pid, SIGKILL);
  Exit ignored;
  wait_process(child, true, ignored);
}

std::string run_process(const std::vector<std::string>& argv, const ProcessLimits& limits,
                        std::string* stderr_tail) {
  Child child = start_process(argv, false, true);
  if (limits.cpu_s > 0) {
    const rlimit limit{limits.cpu_s, limits.cpu_s + 1};
    prlimit(child.pid, RLIMIT_CPU, &limit, nullptr);
  }
  if (limits.memory > 0) {
    const rlimit limit{limits.memory, limits.memory};
    prlimit(child.pid, RLIMIT_DATA, &limit, nullptr);
  }
  std::string output;
  const auto give_up = [&](const std::string& why) {
    kill_process(child);
    throw RuntimeError(fmt::format("the program '{}' was killed: {}", argv[0], why));
  };
  char buffer[1 << 14];
  while (true) {
    pollfd polled{child.out.get(), POLLIN, 0};
    constexpr double kMaxMs = 1e9;  // eleven days
    const int ready = poll(&polled, 1, static_cast<int>(std::min(kMaxMs, 1000 * limits.silence_s)));
    if (ready < 0 && errno == EINTR) continue;
    if (ready == 0) give_up(fmt::format("it printed nothing for {:g} s", limits.silence_s));
    const ssize_t n = read(child.out.get(), buffer, sizeof buffer);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    output.append(buffer, static_cast<std::size_t>(n));
    if (output.size() > limits.max_bytes)
      give_up(fmt::format("it printed more than {} bytes", limits.max_bytes));
  }
  Exit result;
  // The program may have closed its output but continue to run.
  for (double waited = 0; !wait_process(child, false, result); waited += 5e-4) {
    if (waited > limits.silence_s)
      give_up(fmt::format("it did not finish within {:g} s", limits.silence_s));
    usleep(500);
  }
  if (!result.ok)
    throw RuntimeError(fmt::format("the program '{}' failed: {}", argv[0], result.why));
  if (stderr_tail) *stderr_tail = last_words(child.log.get());
  return output;
}

std::string ffmpeg_program(const std::string& wanted) {
  if (!wanted.empty()) return wanted;
  const char* from_environment = std::getenv("MJSENSE_FFMPEG");
  return from_environment && *from_environment ? from_environment : "ffmpeg";
}

}  // namespace mjsense::record
