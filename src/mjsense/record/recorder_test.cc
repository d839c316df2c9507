// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/recorder.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "mjsense/core/files/regular_file.h"
#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/recorded_house.h"
#include "mjsense/record/recording_plan.h"
#include "mjsense/record/testing/tools.h"
#include "mjsense/record/video_file.h"
#include "mjsense/replay/recording_tools.h"

namespace mjsense::record {
namespace {

using namespace testing;
using ::testing::HasSubstr;

TEST(Recorder, BytesDoNotDependOnWorldsOrOrder) {
  TempDir one, three, discards;
  const std::string bytes = write_recording(one.path, 5, {.worlds = 1});
  EXPECT_EQ(bytes, write_recording(three.path, 5, {.worlds = 3}));
  EXPECT_NE(bytes, write_recording(discards.path, 5, {.worlds = 3, .discard_every = 2}));
}

TEST(Recorder, StoresTheArchiveAndTheArraysOfAnEpisode) {
  TempDir out;
  FakeSuite suite(without_video(1));
  RecordingCfg cfg = fake_recording(out.path, suite, 1, 1);
  cfg.archive_name = "model_12345678.zip";
  cfg.archive = "bytes of the archive";
  const fs::path archive = out.path / "house_0" / cfg.archive_name;
  { const Recorder unused(cfg); }
  EXPECT_FALSE(fs::exists(archive));  // nothing was recorded
  Recorder recorder(cfg);
  EXPECT_EQ(read_file(archive), cfg.archive);
  recorder.begin_episode(0, {0, 7});
  suite.fill(0, 0, 0, 1);
  recorder.append(0, {});
  const std::vector<double> sizes{1, 2, 3, 4, 5, 6};
  const auto bytes = std::as_bytes(std::span(sizes));
  recorder.finish_episode(0, "{}", "success",
                          {{"model/geom_size",
                            "Sizes.",
                            "m",
                            "",
                            DType::kFloat64,
                            {2, 3},
                            {bytes.begin(), bytes.end()}}});
  recorder.complete();
  const hdf5::H5Lock lock;
  const hdf5::Id file = hdf5::open_file(out.path / "house_0/trajectories_batch_1_of_1.h5");
  const hdf5::Id array = hdf5::open_dataset(file, "traj_0/replay/model/geom_size");
  EXPECT_EQ(hdf5::dims(array), (std::vector<hsize_t>{2, 3}));
  std::vector<double> read(6);
  ASSERT_GE(H5Dread(array, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, read.data()), 0);
  EXPECT_EQ(read, sizes);
}

TEST(Recorder, WorldsMayAppendFromDifferentThreads) {
  TempDir one, four;
  const std::string bytes = write_recording(one.path, 4, {.worlds = 1, .steps = 40});
  {
    FakeSuite suite(without_video(4));
    Recorder recorder(fake_recording(four.path, suite, 4, 4));
    std::vector<std::thread> threads;
    for (int w = 0; w < 4; ++w) {
      threads.emplace_back([&, w] {
        recorder.begin_episode(w, {w, 7});
        for (int t = 0, T = length_of(w, 40); t < T; ++t) {
          suite.fill(w, w, t, T);
          recorder.append(w, {0.5f * static_cast<float>(t + 1), t + 1 == T, false, t + 1 == T});
        }
        recorder.finish_episode(w, FakeSuite::obs_scene(w), "success");
      });
    }
    for (std::thread& t : threads) t.join();
    recorder.complete();
  }
  std::string again;
  for (const std::string& name : tree(four.path)) again += read_file(four.path / name);
  EXPECT_EQ(bytes, again);
}

TEST(Recorder, ResumingGivesTheFilesOfAnUninterruptedRun) {
  TempDir whole, broken;
  const std::string bytes = write_recording(whole.path, 6, {.worlds = 2, .discard_every = 3}, true);
  for (const int count : {1, 3}) {  // episodes that are added before the recorder is destroyed
    write_recording(broken.path, 6, {.worlds = 2, .discard_every = 3, .stop_after = count}, true,
                    [&](RecordingCfg& c) { c.resume = true; });
    EXPECT_TRUE(fs::exists(broken.path / "house_0/.recording"));
  }
  EXPECT_EQ(bytes, write_recording(broken.path, 6, {.worlds = 3, .discard_every = 3}, true,
                                   [&](RecordingCfg& c) { c.resume = true; }));
  EXPECT_EQ(tree(whole.path), tree(broken.path));
  // Resuming a complete recording changes nothing and records nothing.
  EXPECT_EQ(bytes, write_recording(broken.path, 6, {.worlds = 2}, true,
                                   [&](RecordingCfg& c) { c.resume = true; }));
}

// The contents of each episode by its number: attributes, datasets by their checksums, and videos.
std::map<std::int64_t, std::string> episodes_of(const fs::path& house) {
  std::map<std::int64_t, std::string> episodes;
  const hdf5::H5Lock lock;
  for (const std::string& name : tree(house)) {
    if (!name.ends_with(".h5")) continue;
    const hdf5::Id file = hdf5::open_file(house / name);
    for (const std::string& trajectory : hdf5::children(file)) {
      const hdf5::Id group = hdf5::open_group(file, trajectory);
      std::string text = hdf5::text_attribute(group, "outcome");
      hdf5::each_dataset(group, [&](const std::string& path) {
        const hdf5::Id dataset = hdf5::open_dataset(group, path);
        text += fmt::format("\n{} {}", path, hdf5::text_attribute(dataset, kChecksumAttribute));
        if (!path.starts_with("obs/sensor_data/")) return;
        std::string video = hdf5::read_bytes(group, path, kFileNameBytes);
        video.resize(video.find('\0'));
        text += " " + video + " " + read_file(house / video);
      });
      const std::int64_t number = hdf5::int_attribute(group, "episode", -1);
      EXPECT_TRUE(episodes.emplace(number, text).second) << number;
    }
  }
  return episodes;
}

// Recordings of attempts [a, b) have together the episodes of a recording of all attempts.
TEST(Recorder, RangesOfAttemptsHaveTheEpisodesOfTheWhole) {
  TempDir whole, parts;
  write_recording(whole.path, 6, {.worlds = 2}, true);
  std::map<std::int64_t, std::string> together;
  struct Range {
    int first, count;
  };
  for (const Range range : {Range{0, 4}, Range{4, 2}}) {
    const fs::path out = parts.path / fmt::format("{}", range.first);
    write_recording(out, range.count, {.worlds = 1}, true, [&](RecordingCfg& c) {
      c.first_attempt = range.first;
      c.num_attempts = range.count;
    });
    together.merge(episodes_of(out / "house_0"));
    EXPECT_TRUE(replay::verify(out).ok()) << replay::verify(out).text();
  }
  EXPECT_EQ(together.size(), 6u);
  EXPECT_EQ(together, episodes_of(whole.path / "house_0"));
  FakeSuite suite(without_video(1));
  RecordingCfg cfg = fake_recording(parts.path / "later", suite, 1, 1);
  cfg.first_attempt = 4;
  Recorder recorder(cfg);
  EXPECT_THAT(error_of([&] { recorder.begin_episode(0, {.episode = 3}); }),
              HasSubstr("episode 3 is before the first one, 4"));
}

TEST(Recorder, AppendContinuesACompletedRecording) {
  const auto append = [](RecordingCfg& c) { c.append = true; };
  const auto resume = [](RecordingCfg& c) { c.resume = true; };
  const auto other = [](RecordingCfg& c) {
    c.append = true;
    c.settings = R"({"seed":8})";
  };
  TempDir whole, dir;
  write_recording(whole.path, 9, {.discard_every = 3}, true);
  write_recording(dir.path, 4, {.discard_every = 3}, true,
                  append);  // there is nothing to continue yet
  EXPECT_THAT(error_of([&] { write_recording(dir.path, 2, {}, true); }),
              HasSubstr("already contains recorded trajectories; resume it, append to it"));
  EXPECT_THAT(error_of([&] { write_recording(dir.path, 2, {}, true, other); }),
              HasSubstr("different recording: 'settings/seed' was 7 and is now 8"));
  write_recording(dir.path, 2, {.discard_every = 3}, true, append);
  write_recording(dir.path, 3, {.discard_every = 3, .stop_after = 2}, true, append);
  EXPECT_THAT(error_of([&] { write_recording(dir.path, 3, {}, true, append); }),
              HasSubstr("contains an unfinished recording; resume it"));
  write_recording(dir.path, 3, {.discard_every = 3}, true, resume);
  EXPECT_EQ(episodes_of(dir.path / "house_0"), episodes_of(whole.path / "house_0"));
  for (const char* name : {"1_of_1", "2_of_2", "3_of_3"}) {
    EXPECT_TRUE(fs::exists(dir.path / fmt::format("house_0/trajectories_batch_{}.h5", name)));
  }
  EXPECT_TRUE(replay::verify(dir.path).ok()) << replay::verify(dir.path).text();
  // A complete recording can be resumed, which changes nothing.
  const std::vector<std::string> files = tree(dir.path);
  write_recording(dir.path, 3, {}, true, resume);
  EXPECT_EQ(tree(dir.path), files);
}

// `repair` publishes the finished episodes of an interrupted recording that continues another one.
TEST(Recorder, AppendedEpisodesCanBeRepaired) {
  TempDir whole, dir;
  write_recording(whole.path, 4, {.worlds = 1}, true);
  write_recording(dir.path, 2, {.worlds = 1}, true);
  write_recording(dir.path, 3, {.worlds = 1, .stop_after = 2}, true,
                  [](auto& c) { c.append = true; });
  EXPECT_THAT(replay::repair(dir.path).text(), HasSubstr("published 2 finished episodes"));
  EXPECT_EQ(episodes_of(dir.path / "house_0"), episodes_of(whole.path / "house_0"));
}

TEST(Recorder, OverwriteRemovesTheRecordingOnly) {
  TempDir fresh, dir;
  const auto overwrite = [](RecordingCfg& c) { c.overwrite = true; };
  const std::string bytes = write_recording(fresh.path, 2, {}, true);
  const fs::path notes = dir.path / "house_0/notes.txt";
  write_recording(dir.path, 5, {}, true);
  std::ofstream(notes) << "mine";
  write_recording(dir.path, 4, {.stop_after = 1}, true, overwrite);
  write_recording(dir.path, 2, {}, true, overwrite);
  EXPECT_EQ(read_file(notes), "mine");
  fs::remove(notes);
  std::string again;
  for (const std::string& name : tree(dir.path)) again += read_file(dir.path / name);
  EXPECT_EQ(again, bytes);
  const auto both = [](RecordingCfg& c) { c.overwrite = c.resume = true; };
  EXPECT_THAT(error_of([&] { write_recording(dir.path, 2, {}, true, both); }),
              HasSubstr("choose one of resume, append and overwrite"));
}

// A reader knows what a dataset contains without the program that wrote it.
TEST(Recorder, EveryDatasetHasUnitFrameAndDescription) {
  TempDir dir;
  write_recording(dir.path, 1, {.worlds = 1}, true);
  const hdf5::H5Lock lock;
  const hdf5::Id file = hdf5::open_file(dir.path / "house_0/trajectories_batch_1_of_1.h5");
  const hdf5::Id trajectory = hdf5::open_group(file, "traj_0");
  EXPECT_EQ(hdf5::int_attribute(trajectory, "steps", -1), length_of(0, 6) - 1);
  hdf5::each_dataset(trajectory, [&](const std::string& path) {
    const hdf5::Id dataset = hdf5::open_dataset(trajectory, path);
    for (const char* name : {"unit", "frame", "description"})
      EXPECT_TRUE(hdf5::has_attribute(dataset, name)) << path << " " << name;
    const bool own = path.find('/') == std::string::npos;
    if (own) {
      EXPECT_NE(hdf5::text_attribute(dataset, "description"), "") << path;
    }
  });
}

// A recording that ended before anything was decided leaves no files; decided episodes are kept.
TEST(Recorder, UndecidedRecordingLeavesNoFiles) {
  TempDir dir;
  FakeSuite suite({2, 16, 12, true, true});
  for (const bool begun : {false, true}) {
    {
      Recorder recorder(fake_recording(dir.path, suite, 2, 4));
      if (begun) recorder.begin_episode(1, {.episode = 0});
    }
    EXPECT_TRUE(tree(dir.path).empty());
    EXPECT_FALSE(fs::exists(dir.path / "house_0"));
  }
  {
    Recorder recorder(fake_recording(dir.path, suite, 2, 4));
    recorder.begin_episode(0, {.episode = 0});
    recorder.discard_episode(0, "no");
  }
  EXPECT_TRUE(fs::exists(dir.path / "house_0/.recording/recording.json"));
  EXPECT_THAT(error_of([&] { Recorder again(fake_recording(dir.path, suite, 2, 4)); }),
              HasSubstr("unfinished recording"));
}

// The recording was killed while it published its episodes: some videos have their final names
// already, but the file of trajectories is missing. The next process completes the publication, and
// nothing can be added any more.
TEST(Recorder, InterruptedPublicationIsCompleted) {
  TempDir whole;
  {
    FakeSuite suite({2, 16, 12, true, true});
    Recorder recorder(fake_recording(whole.path, suite, 2, 8));
    record_all(recorder, suite, {.worlds = 2, .stop_after = 3});
    for (int w = 0; w < 2; ++w)
      if (recorder.recording(w)) recorder.abandon_episode(w);
    recorder.complete();
  }
  const std::string h5_name = "house_0/trajectories_batch_1_of_2.h5";
  ASSERT_TRUE(fs::exists(whole.path / h5_name));
  for (const bool by_repair : {false, true}) {
    for (const int moved : {0, 2}) {
      TempDir broken;
      write_recording(broken.path, 8, {.worlds = 2, .stop_after = 3}, true);
      const fs::path house = broken.path / "house_0", staging = house / ".recording";
      std::ofstream(staging / "ending").flush();
      for (int e = 0; e < moved; ++e) {
        const fs::path episode = staging / fmt::format("episode_{:08d}", e);
        const std::string name = fmt::format("episode_{:08d}_wrist_camera.mp4", e);
        ASSERT_TRUE(fs::exists(episode / "wrist_camera.mp4"));
        fs::rename(episode / "wrist_camera.mp4", house / name);
      }
      if (by_repair) {
        replay::repair(broken.path);
      } else {
        FakeSuite suite({2, 16, 12, true, true});
        RecordingCfg cfg = fake_recording(broken.path, suite, 2, 8);
        cfg.resume = true;
        Recorder recorder(cfg);
        EXPECT_TRUE(recorder.has_all_episodes());
        EXPECT_THAT(error_of([&] { recorder.begin_episode(0, {7, 0}); }), HasSubstr("is complete"));
      }
      EXPECT_EQ(tree(broken.path), tree(whole.path)) << moved;
      EXPECT_EQ(read_file(broken.path / h5_name), read_file(whole.path / h5_name)) << moved;
      EXPECT_TRUE(replay::verify(broken.path).ok()) << replay::verify(broken.path).text();
    }
  }
}

// A batch is published once its episodes are final, that is, all earlier ones are kept or
// discarded.
TEST(Recorder, BatchWaitsForEarlierEpisodes) {
  TempDir dir;
  FakeSuite suite(without_video(3));
  RecordingCfg cfg = fake_recording(dir.path, suite, 3, 4);
  cfg.batches = 2;
  Recorder recorder(cfg);
  for (int w = 0; w < 3; ++w) recorder.begin_episode(w, {w, 7});
  const auto finish = [&](int world, std::int64_t episode) {
    suite.fill(world, episode, 0, 1);
    recorder.append(world, {1, true, false, true});
    recorder.finish_episode(world, "{}", "success");
  };
  finish(1, 1);
  finish(2, 2);  // two are kept, but episode 0 may still precede them
  recorder.flush();
  EXPECT_THAT(tree(dir.path / "house_0"),
              ::testing::Not(::testing::Contains(HasSubstr("batch_1_of_2"))));
  EXPECT_FALSE(recorder.has_all_episodes());
  recorder.discard_episode(0, "for the test");
  recorder.flush();
  EXPECT_THAT(tree(dir.path / "house_0"),
              ::testing::Contains(HasSubstr("trajectories_batch_1_of_2.h5")));
}

// Episodes counted by saved() are on disk, even if the program crashes next.
TEST(Recorder, SavedEpisodesAreOnDisk) {
  TempDir dir;
  FakeSuite suite(without_video(1));
  constexpr int kEpisodes = 8;
  RecordingCfg cfg = fake_recording(dir.path, suite, 1, kEpisodes);
  cfg.batches = 1;
  Recorder recorder(cfg);
  for (int e = 0; e < kEpisodes - 1; ++e) {  // the batch stays incomplete, so nothing is published
    recorder.begin_episode(0, {e, 7});
    suite.fill(0, e, 0, 1);
    recorder.append(0, {1, true, false, true});
    recorder.finish_episode(0, "{}", "success");
    for (int saved = e; saved == e && !HasFailure();) {
      saved = recorder.saved();
      const std::size_t found = finished_episodes(dir.path / "house_0").size();
      EXPECT_GE(found, static_cast<std::size_t>(saved));
    }
  }
  EXPECT_EQ(recorder.saved(), kEpisodes - 1);
}

TEST(Recorder, FewEncodersGiveTheSameVideos) {
  TempDir many, few;
  const Attempts attempts{.worlds = 4, .steps = 12};
  const std::string bytes = write_recording(many.path, 5, attempts, true);
  for (const int encoders : {1, 3}) {
    EXPECT_EQ(bytes, write_recording(few.path / std::to_string(encoders), 5, attempts, true,
                                     [&](RecordingCfg& c) {
                                       c.video.max_encoders = encoders;
                                       c.video.queue_frames = 1;
                                     }));
  }
}

TEST(Recorder, SlowEncoderBlocksTheProducerWithoutLoss) {
  TempDir dir, tools;
  FakeSuite suite({1, 16, 12, true, false});
  RecordingCfg cfg = fake_recording(dir.path, suite, 1, 1);
  // Takes one frame every 10 ms.
  cfg.video.ffmpeg = fake_ffmpeg(
      tools.path, "for i in $(seq 60); do head -c 576; sleep 0.01; done | ffmpeg \"$@\"");
  cfg.video.queue_frames = 2;
  constexpr int kSteps = 60;
  Recorder recorder(cfg);
  recorder.begin_episode(0, {});
  for (int t = 0; t < kSteps; ++t) {
    suite.fill(0, 0, t, kSteps);
    recorder.append(0, {});
  }
  recorder.finish_episode(0, "{}");
  recorder.complete();
  const Fd video = open_plain(dir.path / "house_0", "episode_00000000_wrist_camera.mp4");
  EXPECT_EQ(read_video_facts(video.get()).frames, kSteps);
  EXPECT_GT(recorder.stats().frames, 0);
}

TEST(Recorder, ProducerWaitsForABlockedEncoder) {
  TempDir dir, tools;
  FakeSuite suite({1, 320, 240, true, false});
  RecordingCfg cfg = fake_recording(dir.path, suite, 1, 1);
  cfg.video.ffmpeg = fake_ffmpeg(tools.path, "sleep 0.5; exec ffmpeg \"$@\"");
  cfg.video.queue_frames = 2;
  Recorder recorder(cfg);
  recorder.begin_episode(0, {});
  constexpr int kFrames = 20;  // 4.6 MB; the pipe holds 1 MiB and the queue 2 frames
  for (int t = 0; t < kFrames; ++t) {
    suite.fill(0, 0, t, kFrames);
    recorder.append(0, {});
  }
  EXPECT_GT(recorder.stats().wait_s, 0.2);
  recorder.finish_episode(0, "{}");
  recorder.complete();
  const Fd video = open_plain(dir.path / "house_0", "episode_00000000_wrist_camera.mp4");
  EXPECT_EQ(read_video_facts(video.get()).frames, kFrames);
}

}  // namespace
}  // namespace mjsense::record
