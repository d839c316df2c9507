// SPDX-License-Identifier: Apache-2.0
// Houses that other processes read, write or left in an intermediate state.

#include "mjsense/record/recording_folder.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <random>
#include <thread>

#include "mjsense/record/recording_lock.h"
#include "mjsense/record/testing/tools.h"
#include "mjsense/replay/recording_tools.h"

namespace mjsense::record {
namespace {

using namespace testing;
using ::testing::AllOf;
using ::testing::HasSubstr;

// Records `decided` of six episodes in three batches.
void begin(const fs::path& out, int decided) {
  write_recording(out, 6, {.worlds = 1, .stop_after = decided}, false,
                  [](auto& c) { c.batches = 3; });
}
std::string go_on(const fs::path& out) {
  return write_recording(out, 6, {.worlds = 1}, false,
                         [](auto& c) { c.batches = 3, c.resume = true; });
}

// The lock must be tested before anything is read. Otherwise files that the other process publishes
// in the meantime would be missed and overwritten.
TEST(RecordingFolder, LockIsTestedBeforeReading) {
  TempDir dir;
  begin(dir.path, 3);
  const fs::path house = dir.path / "house_0";
  std::ofstream(house / "trajectories_batch_2_of_3.h5") << "half a file";
  EXPECT_FALSE(is_locked(house));
  {
    const Fd other = lock_recording(Folder::open(house), false);
    EXPECT_TRUE(is_locked(house));
    EXPECT_THAT(error_of([&] { go_on(dir.path); }), HasSubstr("another process is recording into"));
    EXPECT_THAT(replay::repair(dir.path).text(), HasSubstr("another process is recording into"));
  }
  EXPECT_FALSE(is_locked(house));
  EXPECT_THAT(error_of([&] { go_on(dir.path); }), HasSubstr("trajectories_batch_2_of_3.h5"));
}

// A recording that is starting has not written its description yet.
TEST(RecordingFolder, RepairIgnoresAStartingRecording) {
  TempDir dir;
  const fs::path house = dir.path / "house_0";
  fs::create_directories(house / kStagingDir);
  {
    const Fd other = lock_recording(Folder::open(house), true);
    EXPECT_THAT(replay::repair(dir.path).text(), HasSubstr("another process is recording into"));
    EXPECT_TRUE(is_locked(house));
  }
  EXPECT_THAT(replay::repair(dir.path).text(), HasSubstr("removed the remains"));
  EXPECT_FALSE(fs::exists(house / kStagingDir));
}

// A reader holds the lock of a house for a moment; that must not prevent a recording.
TEST(RecordingFolder, ReadersDoNotBlockRecording) {
  TempDir whole, dir;
  const std::string bytes = go_on(whole.path);
  begin(dir.path, 1);
  Fd look(open((dir.path / "house_0/.recording/lock").c_str(), O_RDONLY | O_CLOEXEC));
  ASSERT_EQ(flock(look.get(), LOCK_SH | LOCK_NB), 0);
  std::thread end([&] {
    usleep(30'000);
    look.reset();
  });
  EXPECT_EQ(go_on(dir.path), bytes);
  end.join();
}

// The process was killed before the last files of an ended recording were removed.
TEST(RecordingFolder, FilesOfAnEndedRecordingAreRemoved) {
  for (const bool locked : {false, true}) {
    TempDir dir;
    const std::string bytes = go_on(dir.path);
    const fs::path staging = dir.path / "house_0/.recording";
    fs::create_directory(staging);
    std::ofstream(staging / "ending").flush();
    if (locked) std::ofstream(staging / "lock").flush();
    EXPECT_EQ(go_on(dir.path), bytes);
    EXPECT_FALSE(fs::exists(staging)) << locked;
  }
}

// A folder of an episode under an unexpected name is not removed and does not prevent resuming.
TEST(RecordingFolder, FoldersOfOtherNamesAreMovedAside) {
  TempDir whole, dir;
  const std::string bytes = go_on(whole.path);
  begin(dir.path, 1);
  const fs::path house = dir.path / "house_0", staging = house / ".recording";
  fs::rename(staging / "episode_00000000", staging / "episode_0");
  FakeSuite suite({1, 16, 12, false, false});
  RecordingCfg cfg = fake_recording(dir.path, suite, 1, 6);
  cfg.batches = 3;
  cfg.resume = true;
  {
    Recorder recorder(cfg);
    ASSERT_EQ(recorder.damage().size(), 1u);
    EXPECT_THAT(recorder.damage()[0],
                AllOf(HasSubstr("episode_0 is not a valid name"), HasSubstr("set aside")));
    EXPECT_TRUE(fs::exists(house / "damaged/episode_0/traj.h5"));
    record_all(recorder, suite, {.worlds = 1});
  }
  fs::remove_all(house / "damaged");
  std::string again;
  for (const std::string& name : tree(dir.path)) again += read_file(dir.path / name);
  EXPECT_EQ(again, bytes);
}

std::string contents(const fs::path& dir) {
  std::string text;
  for (const std::string& name : tree(dir)) text += name + "\n" + read_file(dir / name);
  return text;
}

// While an episode is recorded, .recording is moved away and replaced by a link to another folder.
// Nothing in the other folder may change, and the recording must report an error.
TEST(RecordingFolder, FolderReplacedByALinkIsNotFollowed) {
  constexpr int kSwaps = 100;
  TempDir foreign, other;
  fs::create_directories(foreign.path / "target/deep/er");
  for (const char* name : {"thesis.txt", "lock", "recording.json", "deep/er/episode_00000000"})
    std::ofstream(foreign.path / "target" / name) << "years of work";
  begin(other.path, 2);
  const fs::path targets[] = {foreign.path / "target", other.path / "house_0/.recording"};
  const std::string before[] = {contents(targets[0]), contents(targets[1])};
  std::mt19937 random(7);
  int swapped_runs = 0;
  for (int n = 0; swapped_runs < kSwaps && n < 20 * kSwaps; ++n) {
    TempDir dir;
    const fs::path staging = dir.path / "house_0/.recording";
    std::atomic<bool> ended = false, swapped = false;
    const auto delay = std::chrono::microseconds(random() % 30'000);
    std::thread swap([&] {
      while (!ended && !fs::is_directory(staging)) std::this_thread::yield();
      const auto until = std::chrono::steady_clock::now() + delay;
      while (!ended && std::chrono::steady_clock::now() < until) std::this_thread::yield();
      std::error_code error;
      fs::rename(staging, dir.path / "moved", error);
      if (error) return;
      fs::create_directory_symlink(targets[n % 2], staging);
      swapped = true;
    });
    const std::string error = error_of([&] { go_on(dir.path); });
    ended = true;
    swap.join();
    if (!swapped) continue;  // the recording had ended
    ++swapped_runs;
    EXPECT_THAT(error, ::testing::AnyOf(HasSubstr("was moved, removed or replaced"),
                                        HasSubstr("is a symbolic link, which is not followed")));
    for (int t : {0, 1}) ASSERT_EQ(contents(targets[t]), before[t]) << n << ": " << error;
    EXPECT_TRUE(fs::is_symlink(staging));
  }
  EXPECT_EQ(swapped_runs, kSwaps);
}

// If the folder is moved back, the recording can be resumed.
TEST(RecordingFolder, FolderThatIsMovedBackIsResumed) {
  TempDir whole, dir;
  const std::string bytes = go_on(whole.path);
  const fs::path staging = dir.path / "house_0/.recording";
  FakeSuite suite({1, 16, 12, false, false});
  RecordingCfg cfg = fake_recording(dir.path, suite, 1, 6);
  cfg.batches = 3;
  {
    Recorder recorder(cfg);
    record_all(recorder, suite, {.worlds = 1, .stop_after = 1});
    fs::rename(staging, dir.path / "moved");
    EXPECT_THAT(error_of([&] { record_all(recorder, suite, {.worlds = 1}); }),
                HasSubstr(".recording' was moved, removed or replaced during the recording"));
  }
  fs::rename(dir.path / "moved", staging);
  EXPECT_EQ(go_on(dir.path), bytes);
}

// The system may write a part of the text and report the error only for the rest.
TEST(RecordingFolder, DescriptionOnAFullDiskThrows) {
  TempDir dir;
  const fs::path report = dir.path / "report";
  const pid_t pid = fork();
  if (pid == 0) {
    signal(SIGXFSZ, SIG_IGN);
    FakeSuite suite({1, 16, 12, false, false});
    RecordingCfg cfg = fake_recording(dir.path / "out", suite, 1, 1);
    cfg.settings = "{\"seed\":\"" + std::string(9000, '7') + "\"}";
    std::ofstream out(report);
    rlimit limit{5000, RLIM_INFINITY};
    setrlimit(RLIMIT_FSIZE, &limit);
    errno = 0;
    out << error_of([&] { Recorder recorder(cfg); }) << std::flush;
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(pid, &status, 0), pid);
  EXPECT_EQ(status, 0);
  EXPECT_THAT(read_file(report), AllOf(HasSubstr("recording.json"), HasSubstr("File too large")));
}

}  // namespace
}  // namespace mjsense::record
