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
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/os.h"

namespace mjsense::record {
namespace {

constexpr std::size_t kKeptWords = 600;  // bytes of stderr in messages

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The last words in one line.
std::string last_words(const Child& child) {
  const auto blank = [](unsigned char c) { return c <= ' '; };
  std::string text = child.words;
  std::replace_if(text.begin(), text.end(), blank, ' ');
  const std::size_t end = text.find_last_not_of(' ');
  return end == text.npos ? "" : printable(text.substr(0, end + 1));
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
            int folder, const SystemLimits& limits) {
  Child child;
  child.limits = limits;
  Fd child_in, child_out, child_log;
  std::tie(child.log, child_log) = make_pipe();
  fcntl(child.log.get(), F_SETFL, O_NONBLOCK);
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

  child.pid = spawn(argv, input >= 0 ? input : child_in.get(), child_out.get(), child_log.get(),
                    folder, limits);
  return child;
}

// 1: has exited; 0: runs; -1: the system keeps no exit status (SIGCHLD is ignored). Its exit status
// stays available.
int has_exited(pid_t pid) {
  siginfo_t about = {};
  int got;
  do {
    got = waitid(P_PID, static_cast<id_t>(pid), &about, WEXITED | WNOHANG | WNOWAIT);
  } while (got < 0 && errno == EINTR);
  return got < 0 ? -1 : about.si_pid != 0;
}

// Kills a child whose exit status was not yet collected, and all processes of its group.
void kill_group(pid_t leader) {
  // The id belongs to the child and its group until the exit status is collected. If the system has
  // discarded the status, a process with this id is another one, and the group is empty.
  const int exited = has_exited(leader);
  // Emulators make vfork() a fork(), after which the child may not have its group yet.
  if (exited == 0) kill(leader, SIGKILL);
  if (exited >= 0 || (kill(leader, 0) != 0 && errno == ESRCH)) kill(-leader, SIGKILL);
}

// Ends the group of a child that has exited or was killed, and collects its exit status.
Exit collect(Child& child) {
  kill_group(child.pid);
  int status = 0;
  rusage usage{};
  pid_t got;
  do {
    got = wait4(child.pid, &status, 0, &usage);
  } while (got < 0 && errno == EINTR);
  child.pid = -1;
  read_log(child);
  child.log.reset();
  Exit result;
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  result.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  const std::string words = last_words(child);
  if (got < 0) {
    result.ok = words.empty();
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
  if (result.ok || words.empty()) return result;
  result.why += ": " + words;
  // "Cannot allocate memory", "MemoryError", "out of memory", std::bad_alloc
  if (child.limits.memory > 0 &&
      (words.find("emory") != words.npos || words.find("bad_alloc") != words.npos))
    result.why += fmt::format(" (its memory limit is {} MiB)", child.limits.memory >> 20);
  if (words.find("Too many open files") != words.npos)
    result.why += fmt::format(" (it may open {} files)", kMaxOpenFiles);
  return result;
}

}  // namespace

Child start_process(const std::vector<std::string>& argv, bool pipe_in, bool pipe_out, int folder,
                    const SystemLimits& limits) {
  return start(argv, pipe_in, pipe_out, -1, folder, limits);
}

Child start_process(const std::vector<std::string>& argv, const Fd& input, int folder,
                    const SystemLimits& limits) {
  return start(argv, false, false, input.get(), folder, limits);
}

void read_log(Child& child) {
  constexpr int kMaxReads = 16;  // the caller has other children
  char piece[1 << 14];
  for (int i = 0; i < kMaxReads && child.log; ++i) {
    const ssize_t n = ::read(child.log.get(), piece, sizeof piece);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == EAGAIN) return;
    if (n <= 0) {
      child.log.reset();
    } else {
      child.words.append(piece, static_cast<std::size_t>(n));
      if (child.words.size() > kKeptWords) child.words.erase(0, child.words.size() - kKeptWords);
    }
  }
}

bool process_ended(Child& child, Exit& result) {
  read_log(child);
  if (has_exited(child.pid) == 0) return false;
  result = collect(child);
  return true;
}

Exit kill_process(Child& child) {
  if (child.pid < 0) return {};
  kill_group(child.pid);
  return collect(child);
}

std::string run_process(const std::vector<std::string>& argv, const ProcessLimits& limits,
                        std::string* stderr_tail, const std::function<void()>& check) {
  struct Running {
    Child child;
    ~Running() { kill_process(child); }
  } running{start_process(argv, false, true, -1, limits.system)};
  Child& child = running.child;
  const auto give_up = [&](const std::string& why) {
    throw RuntimeError(fmt::format("the program '{}' was killed: {}", argv[0], why));
  };
  std::string output;
  char buffer[1 << 14];
  Clock::time_point heard = Clock::now();
  while (true) {
    if (check) check();
    constexpr double kPeriodMs = 100;
    const double left_ms = 1000 * (limits.silence_s - seconds_since(heard));
    pollfd polled[] = {{child.out.get(), POLLIN, 0}, {child.log.get(), POLLIN, 0}};
    const int ready = poll(polled, std::size(polled),
                           static_cast<int>(std::ceil(std::clamp(left_ms, 0.0, kPeriodMs))));
    if (ready < 0 && errno == EINTR) continue;
    if (polled[1].revents != 0) read_log(child);
    if (polled[0].revents == 0) {
      if (left_ms <= 0) give_up(fmt::format("it printed nothing for {:g} s", limits.silence_s));
      // A process that it has left behind keeps its stdout open.
      if (ready == 0 && has_exited(child.pid) != 0) kill_group(child.pid);
      continue;
    }
    const ssize_t n = ::read(child.out.get(), buffer, sizeof buffer);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    heard = Clock::now();
    output.append(buffer, static_cast<std::size_t>(n));
    if (output.size() > limits.max_bytes)
      give_up(fmt::format("it printed more than {} bytes", limits.max_bytes));
  }
  Exit result;
  // The program may have closed its output but continue to run.
  for (double waited = 0; !process_ended(child, result); waited += 5e-4) {
    if (waited > limits.silence_s)
      give_up(fmt::format("it did not finish within {:g} s", limits.silence_s));
    if (check) check();
    usleep(500);
  }
  if (!result.ok)
    throw RuntimeError(fmt::format("the program '{}' failed: {}", argv[0], result.why));
  if (stderr_tail) *stderr_tail = last_words(child);
  return output;
}

std::string ffmpeg_program(const std::string& wanted) {
  if (!wanted.empty()) return wanted;
  const char* from_environment = std::getenv("MJSENSE_FFMPEG");
  return from_environment && *from_environment ? from_environment : "ffmpeg";
}

}  // namespace mjsense::record
