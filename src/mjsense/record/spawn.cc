// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/spawn.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "mjsense/core/error.h"
#include "mjsense/core/system/os.h"

namespace mjsense::record {
namespace {

constexpr int kFirstOther = 3;  // first descriptor after the standard streams

struct Plan {
  char* const* argv;
  int streams[3];
  int folder;
  SystemLimits limits;
  const std::vector<int>* open;  // open descriptors, for kernels before 5.9
  volatile int error = 0;        // set by the child, which shares this memory
};

// A lower limit that the user has set stays in force. At the first limit of the CPU time the program
// receives SIGXCPU, and `beyond` seconds later SIGKILL.
void limit(decltype(RLIMIT_CPU) what, rlim_t maximum, rlim_t beyond = 0) {
  rlimit now = {};
  getrlimit(what, &now);
  now.rlim_cur = std::min(now.rlim_cur, maximum);
  now.rlim_max = std::min(now.rlim_max, maximum + beyond);
  setrlimit(what, &now);
}

// The child of vfork() shares memory with the suspended parent, so it may only make system calls.
// All signals are blocked.
[[noreturn]] __attribute__((noinline)) void become(Plan& plan) {
  const auto fail = [&] {
    plan.error = errno;
    _exit(127);
  };
  // From here on signals to the parent's group do not reach this process...
  if (setpgid(0, 0) != 0) fail();
  if (plan.folder >= 0 && fchdir(plan.folder) != 0) fail();
  int moved[3];  // copies with numbers that do not conflict
  for (int i = 0; i < 3; ++i) {
    moved[i] = fcntl(plan.streams[i], F_DUPFD_CLOEXEC, kFirstOther);
    if (moved[i] < 0) fail();
  }
  for (int i = 0; i < 3; ++i) {
    if (dup2(moved[i], i) < 0) fail();
  }
  if (!os::close_files(kFirstOther, ~0U)) {
    for (const int fd : *plan.open) close(fd);
    for (const int fd : moved) close(fd);
  }
  limit(RLIMIT_NOFILE, kMaxOpenFiles);
  limit(RLIMIT_CORE, 0);
  if (plan.limits.cpu_s > 0) limit(RLIMIT_CPU, plan.limits.cpu_s, 1);
  if (plan.limits.memory > 0) limit(RLIMIT_DATA, plan.limits.memory);
  // ...and pending ones are discarded by ignoring each signal once.
  for (int signal = 1; signal < NSIG; ++signal) {
    struct sigaction action = {};
    action.sa_handler = SIG_IGN;
    sigaction(signal, &action, nullptr);
    action.sa_handler = SIG_DFL;
    sigaction(signal, &action, nullptr);
  }
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  execvp(plan.argv[0], plan.argv);
  fail();
  __builtin_unreachable();
}

}  // namespace

pid_t spawn(const std::vector<std::string>& argv, int in, int out, int log, int folder,
            const SystemLimits& limits) {
  std::vector<char*> args;
  for (const std::string& a : argv) args.push_back(const_cast<char*>(a.c_str()));
  std::string program = argv[0];
  // A path such as "./ffmpeg" is relative to the current directory.
  if (folder >= 0 && program.find('/') != std::string::npos) {
    std::error_code ignored;
    program = std::filesystem::absolute(program, ignored).string();
    args[0] = program.data();
  }
  args.push_back(nullptr);
  const std::vector<int> open = os::open_files(kFirstOther);
  Plan plan{args.data(), {in, out, log}, folder, limits, &open};

  sigset_t all, before;
  sigfillset(&all);
  // No signal handler of the parent may run in the child.
  pthread_sigmask(SIG_SETMASK, &all, &before);
  const pid_t pid = vfork();  // NOLINT(clang-analyzer-security.insecureAPI.vfork)
  if (pid == 0) become(plan);
  const int error = pid < 0 ? errno : plan.error;
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  if (pid > 0 && error != 0) {
    while (waitpid(pid, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  if (error != 0)
    throw CannotStart(
        fmt::format("cannot start the program '{}': {}", argv[0], std::strerror(error)));
  return pid;
}

}  // namespace mjsense::record
