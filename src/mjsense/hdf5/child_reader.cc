// SPDX-License-Identifier: Apache-2.0
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
#include <cstdio>
#include <cstring>
#include <limits>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/files/file_descriptor.h"
#include "mjsense/core/system/os.h"
#include "mjsense/hdf5/untrusted_file.h"

namespace mjsense::hdf5 {
namespace {

// Sanitisers need their signal handlers, their address space, and stderr for their reports.
#ifdef __has_feature
#define MJSENSE_HAS_FEATURE(x) __has_feature(x)
#else
#define MJSENSE_HAS_FEATURE(x) 0
#endif
#if defined(__SANITIZE_ADDRESS__) || MJSENSE_HAS_FEATURE(address_sanitizer)
constexpr bool kSanitised = true;
#else
constexpr bool kSanitised = false;
#endif

constexpr std::uint64_t kMinSeconds = 20, kBytesPerSecond = 2'000'000;
constexpr std::uint64_t kElapsedPerCpuSecond =
    30;  // seconds of elapsed time per second of processor time
constexpr std::uint64_t kMemory = std::uint64_t{1} << 30;
constexpr std::size_t kMaxAnswer = std::size_t{1} << 28;
// The last byte of an answer. Without it the child did not finish.
constexpr char kDone = 'D', kThrown = 'T';

// Blocks all signals in this thread during its lifetime, and in children forked meanwhile.
class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_;
};

void set_limit(decltype(RLIMIT_CPU) what, std::uint64_t maximum, std::uint64_t beyond = 0) {
  const rlimit limit{maximum, maximum + beyond};
  setrlimit(what, &limit);  // a lower hard limit set by the user stays in force
}

// Limits the child: no signal handlers of the parent, no writing to files, bounded processor time
// and memory.
void confine(int answer, std::uint64_t seconds, int file) {
  os::die_with_parent();
  // Ctrl-C is meant for the parent. If it ended the child, the file would be reported as damaged.
  // Signals that were sent to the group so far are discarded by ignoring them.
  setpgid(0, 0);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP, SIGALRM, SIGUSR1, SIGUSR2})
    ::signal(signal, SIG_IGN);
  // Close inherited files, so that the child does not keep locks of the parent after the parent has
  // ended. Kernels before 5.9 leave the files open.
  unsigned first = STDERR_FILENO + 1;
  for (const int kept : {std::min(answer, file), std::max(answer, file)}) {
    if (kept < static_cast<int>(first)) continue;
    os::close_files(first, static_cast<unsigned>(kept) - 1);
    first = static_cast<unsigned>(kept) + 1;
  }
  os::close_files(first, ~0U);
  for (const int signal : {SIGTERM, SIGXCPU}) ::signal(signal, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  pthread_sigmask(SIG_SETMASK, &none, nullptr);
  // The soft limit sends SIGXCPU first; a SIGKILL then comes from outside.
  set_limit(RLIMIT_CPU, seconds, 1);
  set_limit(RLIMIT_CORE, 0);
  if (kSanitised) return;
  for (const int signal : {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT}) ::signal(signal, SIG_DFL);
  if (const Fd null(open("/dev/null", O_WRONLY | O_CLOEXEC)); null)
    dup2(null.get(), STDERR_FILENO);  // glibc's messages about corrupted memory
  set_limit(RLIMIT_FSIZE, 0);
  if (const std::uint64_t now = os::address_space(); now > 0) set_limit(RLIMIT_AS, now + kMemory);
}

void send(int fd, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t n = write(fd, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return;
    done += static_cast<std::size_t>(n);
  }
}

[[noreturn]] void child(int fd, std::uint64_t seconds, const std::function<std::string()>& read,
                        int file) {
  confine(fd, seconds, file);
  std::string answer;
  try {
    answer = read() + kDone;
  } catch (const std::bad_alloc&) {
    answer = std::string("it needs more than 1 GiB of memory") + kThrown;
  } catch (const std::exception& e) {
    answer = e.what() + std::string(1, kThrown);
  }
  send(fd, answer);
  _exit(0);
}

// Reads the child's answer. Returns false unless the child finished within `seconds`.
bool listen(int fd, std::uint64_t seconds, std::string& answer) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::seconds(seconds);
  std::vector<char> piece(1 << 16);
  while (answer.size() < kMaxAnswer) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
    pollfd polled{fd, POLLIN, 0};
    const std::int64_t maximum = std::numeric_limits<int>::max();  // ms: 24 days
    const int ready =
        poll(&polled, 1, static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, maximum)));
    if (ready < 0 && errno == EINTR) continue;
    if (ready == 0 && left.count() > maximum) continue;
    if (ready <= 0) return false;
    const ssize_t n = read(fd, piece.data(), piece.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return n == 0;
    answer.append(piece.data(), static_cast<std::size_t>(n));
  }
  return false;
}

}  // namespace

std::string in_child(std::string_view what, std::uint64_t file_bytes,
                     const std::function<std::string()>& read, std::uint64_t timeout_s, int file) {
  const std::uint64_t seconds = kMinSeconds + file_bytes / kBytesPerSecond;
  if (timeout_s == 0) timeout_s = kElapsedPerCpuSecond * seconds;
  auto [out, in] = os::make_pipe();
  if (!out)
    throw RuntimeError(fmt::format("{}: cannot create a pipe: {}", what, std::strerror(errno)));
  pid_t pid;
  {
    const H5Lock lock;  // so that no other thread is inside the library during the fork
    const SignalsBlocked blocked;
    pid = fork();  // not posix_spawn(): `read` is a function of this process, not a program
    if (pid == 0) {
      out.reset();
      H5Lock::alone();
      // Move the pipe above the standard streams: if stderr was closed, the pipe may have its
      // number, which confine() redirects.
      child(fcntl(in.get(), F_DUPFD_CLOEXEC, STDERR_FILENO + 1), seconds, read, file);
    }
  }
  if (pid < 0)
    throw RuntimeError(fmt::format("{}: cannot start a process: {}", what, std::strerror(errno)));
  in.reset();
  std::string answer;
  const bool heard = listen(out.get(), timeout_s, answer);
  if (!heard) kill(pid, SIGKILL);
  int status = 0;
  rusage used = {};
  pid_t got;
  do {
    got = wait4(pid, &status, 0, &used);
  } while (got < 0 && errno == EINTR);
  const bool ended = got < 0 || (WIFEXITED(status) && WEXITSTATUS(status) == 0);
  if (ended && !answer.empty() && (answer.back() == kDone || answer.back() == kThrown)) {
    const bool thrown = answer.back() == kThrown;
    answer.pop_back();
    if (thrown) throw RuntimeError(answer);
    return answer;
  }
  if (got >= 0 && WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    const auto worked = static_cast<std::uint64_t>(used.ru_utime.tv_sec + used.ru_stime.tv_sec);
    if (signal == SIGKILL && !heard && worked < seconds)
      throw ReaderInterrupted(
          fmt::format("{}: reading it was stopped after {} s, of which {} s were CPU time: the "
                      "machine or the disk is busy",
                      what, timeout_s, worked));
    if (signal == SIGXCPU || (signal == SIGKILL && !heard))
      throw RuntimeError(
          fmt::format("{}: reading it did not finish within {} s: it is damaged", what, seconds));
    if (signal == SIGKILL || signal == SIGTERM)
      throw ReaderInterrupted(fmt::format(
          "{}: the process that read it was killed from outside ({})", what, strsignal(signal)));
    throw RuntimeError(
        fmt::format("{}: the HDF5 library crashed while reading it ({}): it is damaged", what,
                    strsignal(signal)));
  }
  throw RuntimeError(
      fmt::format("{}: the process that read it ended without a result: it is damaged", what));
}

}  // namespace mjsense::hdf5
