// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/process.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"

namespace mjsense::record {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
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

TEST(Process, CpuTimeMemoryAndFilesAreLimited) {
  const ProcessLimits limits{.silence_s = 100,
                             .system = {.cpu_s = 1, .memory = std::size_t{1} << 28}};
  EXPECT_EQ(why_ended("print(len(bytearray(1 << 20)))", limits), "");
  EXPECT_THAT(why_ended("while True: pass", limits), HasSubstr("exceeded its CPU time limit"));
  EXPECT_THAT(why_ended("bytearray(1 << 29)", limits),
              HasSubstr("MemoryError (its memory limit is 256 MiB)"));
  EXPECT_THAT(
      why_ended("import os\nos.execlp('python3', 'python3', '-c', 'bytearray(1 << 29)')", limits),
      HasSubstr("MemoryError"));
  EXPECT_THAT(why_ended("all = [open('/dev/null') for _ in range(300)]", limits),
              AllOf(HasSubstr("Too many open files"), HasSubstr("(it may open 256 files)")));
  EXPECT_EQ(run_process({"sh", "-c", "ulimit -c"}), "0\n");
}

TEST(Process, LimitsOfFilesDoNotConcernThisProcess) {
  std::vector<Fd> many;
  for (int i = 0; i < 300; ++i) many.emplace_back(open("/dev/null", O_RDONLY | O_CLOEXEC));
  EXPECT_EQ(run_process({"echo", "out"}), "out\n");
}

// Whether a process runs. It may stay as a zombie if the parent that it was given does not collect it.
bool runs(pid_t pid) {
  std::string state;
  std::ifstream file("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("State:")) state = line.substr(7, 1);
  }
  return !state.empty() && state != "Z" && state != "X";
}

bool ends(pid_t pid) {
  for (int i = 0; i < 1000 && runs(pid); ++i) usleep(5000);
  return pid > 0 && !runs(pid);
}

TEST(Process, OfAFloodOnlyTheLastWordsAreKept) {
  // Flood while the program runs, before it reads, and after it has closed its output.
  for (const char* script :
       {"head -c 100000000 /dev/zero >&2; echo the end >&2; exit 3",
        "exec >&-; head -c 100000000 /dev/zero >&2; echo the end >&2; exit 3"}) {
    const std::string why = error_of<RuntimeError>([&] { run_process({"sh", "-c", script}); });
    EXPECT_THAT(why, HasSubstr("exit code 3: ")) << script;
    EXPECT_THAT(why, EndsWith(" the end"));
    EXPECT_LT(why.size(), 1000U);
  }
  Child child = start_process(
      {"sh", "-c", "head -c 100000000 /dev/zero >&2; echo the end >&2; exit 3"}, true, false);
  struct stat about = {};
  ASSERT_EQ(fstat(child.log.get(), &about), 0);
  EXPECT_TRUE(S_ISFIFO(about.st_mode));
  Exit exit;
  while (!process_ended(child, exit)) EXPECT_LT(child.words.size(), 1000U);
  EXPECT_THAT(exit.why, EndsWith(" the end"));
}

TEST(Process, LastWordsAreOnePrintableLine) {
  EXPECT_EQ(
      error_of<RuntimeError>([&] {
        run_process({"sh", "-c", "printf 'a\\nb\\r\\033[31m \\377 \\000 c\\n\\n' >&2; exit 1"});
      }),
      "the program 'sh' failed: exit code 1: a b  [31m ?   c");
}

TEST(Process, WhatAProgramLeavesBehindIsKilled) {
  const std::string left = run_process({"sh", "-c", "sleep 1000 > /dev/null & echo $!"});
  EXPECT_TRUE(ends(std::atoi(left.c_str()))) << left;
  // This one keeps the program's stdout.
  const std::string holds = run_process({"sh", "-c", "sleep 1000 & echo $!"}, {.silence_s = 20});
  EXPECT_TRUE(ends(std::atoi(holds.c_str()))) << holds;
}

TEST(Process, WhatAProgramLeavesBehindIsKilledIfSigchldIsIgnored) {
  const pid_t pid = fork();
  if (pid == 0) {
    signal(SIGCHLD, SIG_IGN);
    const std::string left = run_process({"sh", "-c", "sleep 1000 > /dev/null & echo $!"});
    _exit(ends(std::atoi(left.c_str())) ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(pid, &status, 0), pid);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

TEST(Process, KillEndsWhatTheProgramHasStarted) {
  Child child = start_process({"sh", "-c", "sleep 1000 & echo $!; wait"}, false, true);
  char text[32] = {};
  ASSERT_GT(read(child.out.get(), text, sizeof text - 1), 0);
  const int started = std::atoi(text);
  EXPECT_TRUE(runs(started));
  EXPECT_THAT(kill_process(child).why, HasSubstr("killed by signal 9"));
  EXPECT_TRUE(ends(started));
  EXPECT_EQ(child.pid, -1);
  kill_process(child);  // does nothing
}

TEST(Process, ProgramsEndIfTheCheckThrows) {
  const auto check = [&, calls = 0]() mutable {
    if (++calls == 3) throw std::runtime_error("interrupted");
  };
  const auto before = std::chrono::steady_clock::now();
  EXPECT_EQ(error_of<std::runtime_error>([&] {
              run_process({"sleep", "1000"}, {}, nullptr, check);
            }),
            "interrupted");
  EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::seconds(30));
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
    while (!process_ended(child, exit)) usleep(100);
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
