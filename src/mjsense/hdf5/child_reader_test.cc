// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <new>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/hdf5/untrusted_file.h"

namespace mjsense::hdf5 {
namespace {

using ::testing::HasSubstr;

std::string complaint(const std::function<std::string()>& read) {
  try {
    static_cast<void>(in_child("x.h5", 0, read));
  } catch (const ReaderInterrupted& e) {
    return std::string("ended: ") + e.what();
  } catch (const RuntimeError& e) {
    return e.what();
  }
  return "";
}

TEST(InChild, ReturnsAnswersAndErrors) {
  EXPECT_EQ(in_child("x.h5", 0, [] { return std::string("said"); }), "said");
  EXPECT_EQ(complaint([]() -> std::string { throw RuntimeError("so it is"); }), "so it is");
}

TEST(InChild, CrashIsReportedAsDamage) {
  EXPECT_THAT(
      complaint([]() -> std::string { std::abort(); }),
      HasSubstr("x.h5: the HDF5 library crashed while reading it (Aborted): it is damaged"));
  EXPECT_THAT(complaint([]() -> std::string { _exit(0); }), HasSubstr("ended without a result"));
}

TEST(InChild, KilledChildIsNotReportedAsDamage) {
  for (const int signal : {SIGKILL, SIGTERM}) {
    EXPECT_THAT(complaint([signal]() -> std::string {
                  kill(getpid(), signal);
                  return "";
                }),
                HasSubstr("ended: x.h5: the process that read it was killed from outside"));
  }
}

// An intact file must not be reported as damaged because the machine was busy.
TEST(InChild, BusyMachineIsNotReportedAsDamage) {
  EXPECT_EQ(
      error_of<ReaderInterrupted>([&] {
        static_cast<void>(in_child(
            "x.h5", 0, [] { return pause() == 0 ? std::string() : std::string(); }, 1));
      }),
      "x.h5: reading it was stopped after 1 s, of which 0 s were CPU time: the machine or the "
      "disk is busy");
}

// As in a daemon: the pipe of the answer gets the numbers of closed standard streams.
TEST(InChild, WorksWithoutStandardStreams) {
  const auto without = [](std::initializer_list<int> closed) {
    const pid_t pid = fork();
    if (pid == 0) {
      for (const int fd : closed) close(fd);
      _exit(complaint([] { return std::string("said"); }).empty() ? 0 : 1);
    }
    int status = 0;
    return waitpid(pid, &status, 0) == pid && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  };
  EXPECT_TRUE(without({STDERR_FILENO}));
  EXPECT_TRUE(without({STDOUT_FILENO, STDERR_FILENO}));
  EXPECT_TRUE(without({STDIN_FILENO, STDERR_FILENO}));
  EXPECT_TRUE(without({STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}));
}

// Ctrl-C signals the whole process group: the parent handles it and the child continues to read.
int read_in_the_rain() {
  if (setpgid(0, 0) != 0) return 2;
  struct sigaction action = {};
  action.sa_handler = [](int) {};
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
  const pid_t rain = fork();
  if (rain == 0) {
    const pid_t group = getppid();
    setpgid(0, 0);
    while (getppid() == group) {
      for (const int signal : {SIGINT, SIGTERM, SIGHUP}) kill(-group, signal);
      usleep(20);
    }
    _exit(0);
  }
  int wrong = 0;
  for (int n = 0; n < 200; ++n) wrong += !complaint([] { return std::string("said"); }).empty();
  kill(rain, SIGKILL);
  waitpid(rain, nullptr, 0);
  return wrong == 0 ? 0 : 1;
}

TEST(InChild, SignalsToTheGroupDoNotReachTheChild) {
  const pid_t pid = fork();
  if (pid == 0) _exit(read_in_the_rain());
  int status = 0;
  ASSERT_EQ(waitpid(pid, &status, 0), pid);
  EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace mjsense::hdf5
