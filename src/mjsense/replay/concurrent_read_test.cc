// SPDX-License-Identifier: Apache-2.0
// Tools that read recordings while another process writes them.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <thread>

#include "mjsense/hdf5/h5.h"
#include "mjsense/record/testing/tools.h"
#include "mjsense/replay/recording_tools.h"

namespace mjsense::replay {
namespace {

using namespace testing;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

record::FakeSuiteCfg without_video() { return {1, 16, 12, false, false}; }

TEST(Live, ActiveRecordingIsReportedAsSuch) {
  TempDir dir;
  record::FakeSuite suite(without_video());
  record::RecordingCfg cfg = fake_recording(dir.path, suite, 1, 4);
  cfg.batches = 2;
  {
    record::Recorder recorder(cfg);
    const auto play = [&](std::int64_t episode) {
      recorder.begin_episode(0, {episode, 7});
      suite.fill(0, episode, 0, 1);
      recorder.append(0, {1, true, false, true});
      recorder.finish_episode(0, "{}", "success");
      recorder.flush();
    };
    play(0);
    EXPECT_THAT(error_of([&] { static_cast<void>(inspect(dir.path)); }),
                HasSubstr("is being recorded: none of its files is published yet"));
    play(1);
    play(2);  // unpublished: may be moved at any time
    const VerifyResult found = verify(dir.path);
    EXPECT_EQ(found.files, 1);
    EXPECT_EQ(found.episodes, 2);
    ASSERT_THAT(found.findings, SizeIs(1)) << found.text();
    EXPECT_THAT(found.text(), HasSubstr("error: house_0 is being recorded: verify it again"));
    ASSERT_THAT(inspect(dir.path).files, SizeIs(1));
    EXPECT_THAT(inspect(dir.path).text(), HasSubstr("house_0: the recording has not ended"));
    play(3);
    recorder.complete();
  }
  EXPECT_THAT(inspect(dir.path).unfinished, IsEmpty());
  EXPECT_TRUE(verify(dir.path).ok()) << verify(dir.path).text();
  EXPECT_THAT(inspect(dir.path).files, SizeIs(2));
}

// Files may be moved between listing and reading them.
TEST(Live, RecordingMayContinueDuringVerify) {
  TempDir dir;
  std::atomic<bool> ended = false;
  std::thread recording([&] {
    for (int stop = 1; stop <= 12; ++stop) {  // started, stopped and resumed
      write_recording(dir.path, 12, {.worlds = 1, .stop_after = stop == 12 ? -1 : 1}, false,
                      [](auto& c) {
                        c.resume = true;
                        c.batches = 6;
                      });
    }
    ended = true;
  });
  int looks = 0;
  while (!ended) {
    if (!fs::exists(dir.path / "house_0/.recording/recording.json")) continue;
    const VerifyResult found = verify(dir.path);
    ++looks;
    for (const Finding& f : found.findings)
      EXPECT_THAT(f.text, ::testing::AnyOf(HasSubstr("is being recorded"),
                                           HasSubstr("changed while it was being read"),
                                           HasSubstr("not yet published")))
          << f.context;
  }
  recording.join();
  EXPECT_GT(looks, 0);
  EXPECT_TRUE(verify(dir.path).ok()) << verify(dir.path).text();
}

// Two versions of a file; one has data beyond the end of the other.
TEST(Live, ReplacedFileIsReportedAsChanged) {
  TempDir dir, other;
  write_recording(dir.path, 2, {.worlds = 1});
  write_recording(other.path, 2, {.worlds = 1, .steps = 90});
  const std::string name = "house_0/trajectories_batch_1_of_1.h5";
  fs::copy_file(dir.path / name, other.path / "first");
  for (const fs::path& path : {other.path / "first", other.path / name})
    fs::resize_file(path, read_file(path).rfind("\nmjsense: crc32"));
  std::atomic<bool> ended = false;
  std::thread replacing([&] {
    for (int n = 0; !ended; ++n) {
      fs::copy_file(other.path / (n % 2 ? "first" : name), dir.path / "new");
      fs::rename(dir.path / "new", dir.path / name);
    }
  });
  for (int n = 0; n < 40; ++n) {
    for (const Finding& f : verify(dir.path / name).findings)
      EXPECT_TRUE(!f.error || f.text == "changed while it was being read: verify it again")
          << f.text;
  }
  ended = true;
  replacing.join();
}

TEST(Live, ReplacedVideoIsReportedAsChanged) {
  TempDir dir;
  write_recording(dir.path, 1, {.worlds = 1}, true);
  const fs::path video = dir.path / "house_0/episode_00000000_wrist_camera.mp4";
  ASSERT_TRUE(fs::exists(video));
  const std::string ffmpeg = fake_ffmpeg(
      dir.path, fmt::format("cp '{0}' '{0}.new'; mv '{0}.new' '{0}'; exit 1", video.string()));
  const VerifyResult found = verify(dir.path / "house_0", {.decode = true, .ffmpeg = ffmpeg});
  EXPECT_THAT(found.text(), HasSubstr("wrist_camera.mp4' changed while it was being read"));
}

// Data sets without elements can claim any number of rows at no cost.
TEST(Inspect, IgnoresClaimedRowsWithoutData) {
  TempDir dir;
  const fs::path path = dir.path / "trajectories_batch_1_of_1.h5";
  {
    const hdf5::H5Lock lock;
    hdf5::Id file = hdf5::create_file(path);
    for (const char* name : {"traj_0", "traj_1"}) {
      const hdf5::Id trajectory = hdf5::create_group(file, name);
      const hsize_t rows[] = {2147483647, 0}, wide[] = {3, hsize_t{1} << 62, 8, 0};
      const auto add = [&](const char* context, int rank, const hsize_t* dims) {
        const hdf5::Id space(H5Screate_simple(rank, dims, nullptr), H5Sclose, "space");
        const hdf5::Id made(H5Dcreate2(trajectory, context, H5T_STD_I8LE, space, H5P_DEFAULT,
                                       H5P_DEFAULT, H5P_DEFAULT),
                            H5Dclose, context);
      };
      add("success", 2, rows);
      add("wide", 4, wide);
    }
    file.close("close");
  }
  const InspectResult result = inspect(path);
  ASSERT_THAT(result.files, SizeIs(1));
  EXPECT_EQ(result.files[0].steps, 2147483647);
}

}  // namespace
}  // namespace mjsense::replay
