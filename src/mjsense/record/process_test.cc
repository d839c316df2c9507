// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/process.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"

namespace mjsense::record {
namespace {

using ::testing::HasSubstr;

TEST(Process, OnlyStandardStreamsAreInherited) {
  // Inheritable, without O_CLOEXEC, as some libraries open files.
  const Fd other(open("/dev/null", O_RDONLY));
  ASSERT_GT(other.get(), 2);
  std::string words;
  const std::string out =
      run_process({"sh", "-c", "echo out; echo err >&2; ls /proc/$$/fd"}, {}, &words);
  EXPECT_EQ(words, "err");
  EXPECT_THAT(out, HasSubstr("out\n0\n1\n2\n"));
  EXPECT_EQ(out.find("\n" + std::to_string(other.get()) + "\n"), std::string::npos);
}

TEST(Process, MissingProgramThrows) {
  EXPECT_EQ(error_of<RuntimeError>([&] {
              run_process({"mjsense_no_such_program", "x"});
            }),
            "cannot start the program 'mjsense_no_such_program': No such file or directory");
}

TEST(Process, LeadsAProcessGroupWithDefaultSignals) {
  sigset_t some, before;
  sigemptyset(&some);
  sigaddset(&some, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &some, &before);
  struct sigaction ignore = {}, old = {};
  ignore.sa_handler = SIG_IGN;
  sigaction(SIGUSR1, &ignore, &old);
  const std::string out = run_process(
      {"sh", "-c",
       "ps -o pgid= -p $$ | tr -d ' '; echo $$; exec grep -E 'Sig(Blk|Ign)' /proc/self/status"});
  sigaction(SIGUSR1, &old, nullptr);
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  int group = 0, pid = -1;
  ASSERT_EQ(std::sscanf(out.c_str(), "%d %d", &group, &pid), 2) << out;
  EXPECT_EQ(group, pid);
  EXPECT_THAT(out, HasSubstr("SigBlk:\t0000000000000000"));
  EXPECT_THAT(out, HasSubstr("SigIgn:\t0000000000000000"));
}

std::string why_ended(const std::string& script, const ProcessLimits& limits) {
  try {
    run_process({"python3", "-c", script}, limits);
    return "";
  } catch (const RuntimeError& e) {
    return e.what();
  }
}

TEST(Process, CpuTimeAndMemoryAreLimited) {
  const ProcessLimits limits{.silence_s = 100, .cpu_s = 1, .memory = std::size_t{1} << 28};
  EXPECT_EQ(why_ended("print(len(bytearray(1 << 20)))", limits), "");
  EXPECT_THAT(why_ended("while True: pass", limits), HasSubstr("exceeded its CPU time limit"));
  EXPECT_THAT(why_ended("import time\ntime.sleep(.3)\nbytearray(1 << 29)", limits),
              HasSubstr("MemoryError"));
}

// Signals are sent repeatedly to a process group that starts programs. The handler of the parent
// receives them, the programs do not. Runs in a separate process that leads such a group.
int start_programs_in_the_rain() {
  if (setpgid(0, 0) != 0) return 2;
  struct sigaction action = {};
  action.sa_handler = [](int) {};
  action.sa_flags = SA_RESTART;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
  const pid_t rain = fork();
  if (rain == 0) {
    const pid_t group = getppid();
    setpgid(0, 0);
    for (int n = 0; getppid() == group; ++n) {
      kill(-group, n % 3 == 0 ? SIGINT : n % 3 == 1 ? SIGTERM : SIGHUP);
      usleep(20);
    }
    _exit(0);
  }
  setpgid(rain, rain);
  int killed = 0;
  for (int n = 0; n < 400; ++n) {
    Child child = start_process({"true"}, false, false);
    Exit exit;
    wait_process(child, true, exit);
    killed += !exit.ok;
  }
  kill(rain, SIGKILL);
  waitpid(rain, nullptr, 0);
  return killed == 0 ? 0 : 1;
}

TEST(Process, SignalsToTheParentsGroupReachNoChild) {
  const pid_t pid = fork();
  if (pid == 0) _exit(start_programs_in_the_rain());
  int status = 0;
  ASSERT_EQ(waitpid(pid, &status, 0), pid);
  EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace mjsense::record
