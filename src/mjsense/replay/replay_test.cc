// SPDX-License-Identifier: Apache-2.0
// Reading recordings: complete ones, and those that an interruption left.

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "mjsense/core/error.h"
#include "mjsense/core/files/file_descriptor.h"
#include "mjsense/hdf5/h5.h"
#include "mjsense/record/testing/tools.h"
#include "mjsense/replay/recording_tools.h"
#include "mjsense/replay/trajectory.h"

namespace mjsense::replay {
namespace {

using namespace testing;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

TEST(Replay, EpisodesReadBackAsWritten) {
  TempDir dir;
  write_recording(dir.path, 3,
                  {.worlds = 2, .steps = 70});  // more rows than one chunk of dict rows
  EXPECT_THAT(tree(dir.path), ::testing::ElementsAre("house_0/trajectories_batch_1_of_1.h5"));
  const hdf5::H5Lock lock;
  const hdf5::Id file = hdf5::open_file(dir.path / "house_0/trajectories_batch_1_of_1.h5");
  ASSERT_THAT(trajectory_names(file), SizeIs(3));
  for (int e = 0; e < 3; ++e) {
    const hdf5::Id traj(H5Gopen2(file, fmt::format("traj_{}", e).c_str(), H5P_DEFAULT), H5Gclose,
                        "traj");
    const int T = length_of(e, 70);
    EXPECT_EQ(hdf5::int_attribute(traj, "episode", -1), e);
    EXPECT_EQ(hdf5::text_attribute(traj, "outcome"), "success");
    EXPECT_EQ(hdf5::read_text(traj, "obs_scene"), record::FakeSuite::obs_scene(e));
    const RowDataset qpos(traj, "obs/agent/qpos"), tcp(traj, "obs/extra/tcp_pose"),
        fail(traj, "fail");
    EXPECT_EQ(qpos.rows(), T);
    EXPECT_TRUE(qpos.is_json());
    EXPECT_EQ(qpos.shape(), "(T, 2000)");
    qpos.each_text([&](std::int64_t t, std::string_view text) {
      EXPECT_THAT(
          std::string(text),
          HasSubstr(fmt::format("{{\"arm\":[{}", static_cast<double>(record::FakeSuite::joint(
                                                     e, static_cast<int>(t), 0)))));
    });
    std::vector<double> values;
    tcp.each_number([&](auto piece) { values.insert(values.end(), piece.begin(), piece.end()); });
    ASSERT_EQ(values.size(), T * 7u);
    for (int t = 0; t < T; ++t) EXPECT_EQ(values[t * 7 + 3], e * 1000 + t + 0.375);
    values.clear();
    fail.each_number([&](auto piece) { values.insert(values.end(), piece.begin(), piece.end()); });
    EXPECT_EQ(fail.dtype(), "bool");
    EXPECT_EQ(std::count(values.begin(), values.end(), 1.0), T - 1);
  }
}

TEST(Replay, DiscardedAttemptsAreNotStored) {
  TempDir dir;
  write_recording(dir.path, 4, {.worlds = 3, .discard_every = 2}, true);
  const InspectResult result = inspect(dir.path);
  ASSERT_THAT(result.files, SizeIs(1));
  EXPECT_EQ(result.files[0].episodes, 4);
  EXPECT_THAT(tree(dir.path), SizeIs(1 + 4 * 2));
  std::vector<std::string> progress;
  const VerifyResult found =
      verify(dir.path, {.progress = [&](const std::string& text) { progress.push_back(text); }});
  EXPECT_TRUE(found.ok()) << found.text();
  ASSERT_THAT(progress, SizeIs(1 + 4 * 2));
  EXPECT_EQ(progress.front(), "1 of 1 files");
  EXPECT_EQ(progress.back(), "8 of 8 videos");
}

TEST(Replay, UnfinishedRecordingIsReadableAndRepairable) {
  TempDir dir;
  write_recording(dir.path, 8, {.worlds = 2, .stop_after = 3}, true);
  const VerifyResult before = verify(dir.path);
  EXPECT_EQ(before.unpublished, 3);
  EXPECT_EQ(before.episodes, 3);
  EXPECT_EQ(before.videos, 6);
  ASSERT_THAT(before.findings, SizeIs(1)) << before.text();
  EXPECT_THAT(before.findings[0].text, HasSubstr("3 finished episodes not yet published"));
  EXPECT_THAT(repair(dir.path).text(), HasSubstr("published 3 finished episodes"));
  const VerifyResult after = verify(dir.path);
  EXPECT_TRUE(after.ok()) << after.text();
  EXPECT_EQ(after.episodes, 3);
  EXPECT_FALSE(fs::exists(dir.path / "house_0/.recording"));
}

// A full disk is simulated by a file size limit.
TEST(Replay, RepairThatCannotWriteLeavesTheRecordingUnfinished) {
  TempDir dir;
  write_recording(dir.path, 8, {.worlds = 2, .stop_after = 3}, true);
  const std::vector<std::string> names = tree(dir.path);
  const pid_t pid = fork();
  if (pid == 0) {
    const rlimit limit{1000, 1000};
    setrlimit(RLIMIT_FSIZE, &limit);
    const RepairResult result = repair(dir.path);
    _exit(result.actions.empty() && result.failures.size() == 1 &&
                  result.failures[0].find("File too large") != std::string::npos
              ? 0
              : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(pid, &status, 0), pid);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(tree(dir.path), names);
}

// A video must have as many frames as its episode has steps, of the stated size.
TEST(Verify, ANoteAboutManyEpisodesIsOneLine) {
  VerifyResult result;
  result.findings = {{false, "a.h5 traj_0", "has no 'qpos'"},
                     {true, "a.h5 traj_0", "has no 'fail'"},
                     {false, "a.h5 traj_1", "has no 'qpos'"},
                     {true, "a.h5 traj_1", "has no 'fail'"},
                     {false, "a.h5 traj_1", "has no 'qvel'"}};
  EXPECT_THAT(result.text(), StartsWith("note: a.h5 traj_0 has no 'qpos' (and 1 more)\n"
                                        "error: a.h5 traj_0 has no 'fail'\n"
                                        "error: a.h5 traj_1 has no 'fail'\n"
                                        "note: a.h5 traj_1 has no 'qvel'\n"
                                        "NOT intact"));
}

TEST(Verify, CountsTheFramesOfEveryVideo) {
  TempDir dir, other;
  write_recording(dir.path, 3, {.worlds = 1}, true);
  ASSERT_TRUE(verify(dir.path).ok());
  const auto video = [](const fs::path& out, int e) {
    return out / fmt::format("house_0/episode_{:08d}_wrist_camera.mp4", e);
  };
  const auto replaced = [&](const fs::path& by, const fs::path& what) {
    const std::string original = read_file(what);
    fs::copy_file(by, what, fs::copy_options::overwrite_existing);
    const VerifyResult result = verify(dir.path);
    std::ofstream(what, std::ios::binary) << original;
    EXPECT_EQ(result.findings.size(), 1u) << result.text();
    return result.ok() ? std::string("intact") : result.findings[0].text;
  };
  // The episodes have 6, 7 and 8 steps.
  EXPECT_THAT(replaced(video(dir.path, 2), video(dir.path, 0)),
              HasSubstr("has 8 frames, expected 6"));
  EXPECT_THAT(replaced(video(dir.path, 0), video(dir.path, 1)),
              HasSubstr("has 6 frames, expected 7"));
  {
    record::FakeSuite suite({1, 20, 12, true, true});
    record::Recorder recorder(fake_recording(other.path, suite, 1, 1));
    record_all(recorder, suite, {.worlds = 1});
  }
  EXPECT_THAT(replaced(video(other.path, 0), video(dir.path, 0)),
              HasSubstr("is 20 x 12 pixels, expected 16 x 12"));
  fs::remove(video(dir.path, 1));
  EXPECT_THAT(verify(dir.path).text(), HasSubstr("does not exist"));
}

// `fail` must be the negation of `success` at every step.
TEST(Verify, FailIsTheNegationOfSuccess) {
  for (const std::int8_t wrong : {0, 1}) {
    TempDir dir;
    write_recording(dir.path, 1, {.worlds = 1});
    const fs::path path = dir.path / "house_0/trajectories_batch_1_of_1.h5";
    {
      const hdf5::H5Lock lock;
      hdf5::Id file = hdf5::open_file(path, true);
      {
        const hdf5::Id fail(H5Dopen2(file, "traj_0/fail", H5P_DEFAULT), H5Dclose, "fail");
        const hdf5::Id type(H5Dget_type(fail), H5Tclose, "type");
        std::vector<std::int8_t> rows(6);
        hdf5::check(H5Dread(fail, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows.data()), "read");
        EXPECT_EQ(rows, (std::vector<std::int8_t>{1, 1, 1, 1, 1, 0}));
        rows[wrong ? 5 : 2] = wrong;  // both true, or both false
        hdf5::check(H5Dwrite(fail, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows.data()), "write");
      }
      file.close("close");
    }
    const VerifyResult result = verify(dir.path);
    EXPECT_FALSE(result.ok());
    EXPECT_THAT(result.text(),
                HasSubstr(fmt::format("row {} is not the opposite of success", wrong ? 5 : 2)));
  }
}

// Files without the names of their videos, as MolmoSpaces writes them.
class RepairNames : public ::testing::Test {
 protected:
  RepairNames() {
    write_recording(dir.path, 6, {.worlds = 1}, true);
    in_videos(true, [&](hid_t videos) {
      was = read_file_name(videos, "wrist_camera");
      hdf5::check(H5Ldelete(videos, "wrist_camera", H5P_DEFAULT), "delete");
    });
  }
  void in_videos(bool write, auto&& act) const {
    const hdf5::H5Lock lock;
    hdf5::Id file = hdf5::open_file(path, write);
    {
      const hdf5::Id videos(H5Gopen2(file, "traj_1/obs/sensor_data", H5P_DEFAULT), H5Gclose,
                            "videos");
      act(videos);
    }
    file.close("close");
  }

  TempDir dir;
  fs::path path = dir.path / "house_0/trajectories_batch_2_of_2.h5";
  std::string was;
};

TEST_F(RepairNames, BelongToTheirBatch) {
  std::string is;
  EXPECT_EQ(was, "episode_00000004_wrist_camera.mp4");
  EXPECT_THAT(repair(dir.path).text(), HasSubstr("added 1 video name"));
  in_videos(false, [&](hid_t videos) { is = read_file_name(videos, "wrist_camera"); });
  EXPECT_EQ(is, was);
  EXPECT_TRUE(verify(dir.path).ok()) << verify(dir.path).text();
  EXPECT_THAT(repair(dir.path).text(), HasSubstr("nothing to repair"));
}

// If repair is killed or the disk is full, the file must be unchanged. Simulated by a file size
// limit.
TEST_F(RepairNames, AreAddedAtomically) {
  const std::string bytes = read_file(path);
  const std::vector<std::string> names = tree(dir.path);
  for (const int more : {-1000, 10, 1000, 3000}) {
    const pid_t pid = fork();
    if (pid == 0) {
      const auto maximum = bytes.size() + static_cast<rlim_t>(more);
      const rlimit limit{maximum, maximum};
      setrlimit(RLIMIT_FSIZE, &limit);
      const RepairResult result = repair(dir.path);
      _exit(result.text().find("File too large") != std::string::npos ? 0 : 1);
    }
    int status = 0;
    ASSERT_EQ(waitpid(pid, &status, 0), pid);
    EXPECT_EQ(status, 0) << more;
    EXPECT_TRUE(read_file(path) == bytes) << more;
    EXPECT_EQ(tree(dir.path), names) << more;
  }
}

TEST_F(RepairNames, KeepThePermissionsOfTheFile) {
  for (const fs::perms mode : {fs::perms(0640), fs::perms(0444)}) {
    fs::permissions(path, mode);
    EXPECT_THAT(repair(dir.path).text(), HasSubstr("added 1 video name"));
    EXPECT_EQ(fs::status(path).permissions(), mode);
    fs::permissions(path, fs::perms(0600));
    in_videos(true, [&](hid_t videos) {
      hdf5::check(H5Ldelete(videos, "wrist_camera", H5P_DEFAULT), "delete");
    });
  }
}

// Two processes would write to the same copy.
TEST_F(RepairNames, ByOneProcessAtATime) {
  const std::string bytes = read_file(path);
  {
    const Fd other(open(path.c_str(), O_RDONLY | O_CLOEXEC));
    ASSERT_EQ(flock(other.get(), LOCK_EX | LOCK_NB), 0);
    EXPECT_THAT(repair(dir.path).text(), HasSubstr("another process is repairing"));
    EXPECT_TRUE(read_file(path) == bytes);
  }
  EXPECT_THAT(repair(dir.path).text(), HasSubstr("added 1 video name"));
}

// "trajectories_batch_1_of_2.h5.bak" is a user's backup.
TEST_F(RepairNames, OnlyInTrajectoryFiles) {
  for (const char* name : {"trajectories_batch_2_of_2.h5.bak", "trajectories_batch_02_of_2.h5",
                           "trajectories_batch_-2147483648_of_3.h5"}) {
    const fs::path other = path.parent_path() / name;
    fs::copy_file(path, other);
    const std::string bytes = read_file(other);
    EXPECT_THAT(error_of([&] { static_cast<void>(repair(other)); }),
                HasSubstr("is not named trajectories_batch_*_of_*.h5"));
    EXPECT_TRUE(read_file(other) == bytes) << name;
    fs::remove(other);
  }
}

TEST(Replay, ImagesOfOddSizeArePadded) {
  TempDir dir;
  record::FakeSuite suite({1, 17, 13});
  record::RecordingCfg cfg = fake_recording(dir.path, suite, 1, 1);
  cfg.video.molmospaces_depth = true;
  {
    record::Recorder recorder(cfg);
    record_all(recorder, suite, {.worlds = 1});
  }
  const VerifyResult result = verify(dir.path, {.decode = true});
  EXPECT_TRUE(result.ok()) << result.text();
  EXPECT_EQ(result.videos, 3);
}

}  // namespace
}  // namespace mjsense::replay
