// SPDX-License-Identifier: Apache-2.0
// Faults give one clear error, and no file gets its final name.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <csignal>
#include <fstream>
#include <functional>
#include <string>

#include "mjsense/record/recorded_house.h"
#include "mjsense/record/recorder.h"
#include "mjsense/record/testing/tools.h"

namespace mjsense::record {
namespace {

using namespace testing;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

void expect_nothing_published(const fs::path& out) {
  if (!fs::exists(out)) return;
  for (const std::string& name : tree(out)) EXPECT_THAT(name, HasSubstr("/.recording/"));
}

TEST(RecorderFaults, FfmpegIsAbsent) {
  TempDir dir;
  const std::string error = error_of([&] {
    write_recording(dir.path, 1, {}, true,
                    [](RecordingCfg& c) { c.video.ffmpeg = "/nonexistent/ffmpeg"; });
  });
  EXPECT_THAT(error, AllOf(HasSubstr("needs ffmpeg"), HasSubstr("/nonexistent/ffmpeg"),
                           HasSubstr("apt-get install ffmpeg")));
  EXPECT_THAT(tree(dir.path), IsEmpty());
  write_recording(dir.path, 1, {}, false, [](RecordingCfg& c) {
    c.video.ffmpeg = "/nonexistent/ffmpeg";
  });  // without video ffmpeg is not needed
}

TEST(RecorderFaults, FfmpegDies) {
  for (const char* body : {"head -c 2000 > $out; echo 'the encoder exploded' >&2; exit 3",
                           "head -c 2000 > /dev/null; kill -9 $$"}) {
    TempDir dir, tools;
    const std::string error = error_of([&] {
      write_recording(dir.path, 2, {.worlds = 2, .steps = 4000}, true,
                      [&](RecordingCfg& c) { c.video.ffmpeg = fake_ffmpeg(tools.path, body); });
    });
    EXPECT_THAT(error,
                AllOf(HasSubstr("cannot be recorded: video 'wrist_camera"), HasSubstr("ffmpeg: ")));
    const bool has_words = std::string(body).find("exploded") != std::string::npos;
    EXPECT_THAT(error, HasSubstr(has_words ? "exit code 3: the encoder exploded" : "signal 9"));
    expect_nothing_published(dir.path);
    EXPECT_THAT(finished_episodes(dir.path / "house_0"), IsEmpty());
  }
}

TEST(RecorderFaults, FfmpegFailsAtTheEnd) {
  TempDir dir, tools;
  const std::string error = error_of([&] {
    write_recording(dir.path, 1, {.worlds = 1}, true, [&](RecordingCfg& c) {
      c.video.ffmpeg = fake_ffmpeg(tools.path, "cat > $out; echo 'no trailer' >&2; exit 1");
    });
  });
  EXPECT_THAT(error, HasSubstr("exit code 1: no trailer"));
  expect_nothing_published(dir.path);
}

// An exit code of 0 is not sufficient: the frames in the output are counted.
TEST(RecorderFaults, FfmpegWritesAnIncompleteVideo) {
  const std::pair<const char*, const char*> lies[] = {
      {"cat > /dev/null; echo garbage > $out",
       "is not a complete video: it is neither MP4 nor Matroska"},
      {"cat > /dev/null", "does not exist"},
      {"cat > /dev/null; : > $out", "is not a complete video: it is empty"},
      {"head -c 864 | ffmpeg \"$@\"; cat > /dev/null", "has 3 frames, expected 6"},
      {"ffmpeg \"$@\"; head -c 700 $out > $out.x; mv $out.x $out", "the file is truncated"},
      {"ffmpeg -loglevel error -f rawvideo -pixel_format yuv420p -video_size 16x12 -i pipe:0 -c:v "
       "mpeg4 -y -f mp4 file:$out",
       "contains mp4v in MP4, expected h264 in MP4"},
      {"ffmpeg -loglevel error -f rawvideo -pixel_format yuv420p -video_size 16x12 -i pipe:0 -c:v "
       "libx264 -y -f matroska file:$out",
       "contains h264 in Matroska, expected h264 in MP4"}};
  for (const auto& [body, complaint] : lies) {
    TempDir dir, tools;
    FakeSuite suite({1, 16, 12, true, false});
    RecordingCfg cfg = fake_recording(dir.path, suite, 1, 1);
    cfg.video.ffmpeg = fake_ffmpeg(tools.path, body);
    const std::string error = error_of([&] {
      Recorder recorder(cfg);
      record_all(recorder, suite, {.worlds = 1});
    });
    EXPECT_THAT(error, AllOf(HasSubstr("episode 0 cannot be recorded: video 'wrist_camera'"),
                             HasSubstr(complaint)));
    expect_nothing_published(dir.path);
    EXPECT_THAT(finished_episodes(dir.path / "house_0"), IsEmpty());
  }
}

// A hanging encoder is killed and reported.
TEST(RecorderFaults, FfmpegHangs) {
  for (const char* body : {"kill -STOP $$", "exec sleep 1000", "cat > /dev/null; exec sleep 1000",
                           // This one uses the CPU occasionally.
                           "cat > /dev/null; while :; do sleep 0.05; done"}) {
    TempDir dir, tools;
    FakeSuite suite({1, 320, 240, true, false});
    RecordingCfg cfg = fake_recording(dir.path, suite, 1, 1);
    cfg.video.ffmpeg = fake_ffmpeg(tools.path, body);
    cfg.video.ffmpeg_timeout = 0.6;
    const std::string error = error_of([&] {
      Recorder recorder(cfg);
      record_all(recorder, suite, {.worlds = 1, .steps = 20});
    });
    EXPECT_THAT(error,
                HasSubstr(std::string(body).starts_with("cat") ? "did not finish for 0.6 s"
                                                               : "accepted no frame for 0.6 s"));
    expect_nothing_published(dir.path);
  }
}

// An encoder never waits for its stderr to be read, however much it writes there.
TEST(RecorderFaults, FfmpegFloodsStderr) {
  for (const bool works : {true, false}) {
    TempDir dir, tools;
    const std::string error = error_of([&] {
      write_recording(dir.path, 1, {.worlds = 1}, true, [&](RecordingCfg& c) {
        c.video.ffmpeg = fake_ffmpeg(
            tools.path,
            std::string("head -c 50000000 /dev/zero | tr '\\0' 'x' >&2\n"
                        "stat -L -c %F /dev/stderr > $0.kind\n") +
                (works ? "exec ffmpeg \"$@\"" : "cat > /dev/null; echo no more >&2; exit 1"));
      });
    });
    EXPECT_EQ(read_file(tools.path / "ffmpeg.kind"), "fifo\n");
    if (works) {
      EXPECT_EQ(error, "");
      EXPECT_THAT(tree(dir.path), ::testing::Contains(HasSubstr("batch_1_of_1.h5")));
    } else {
      EXPECT_THAT(error, AllOf(HasSubstr("exit code 1: xxx"), HasSubstr("xxxno more")));
      EXPECT_LT(error.size(), 1000U);
    }
  }
}

// Processes that an encoder has started end with it, whether it finishes or hangs.
TEST(RecorderFaults, FfmpegLeavesProcesses) {
  for (const bool hangs : {false, true}) {
    TempDir dir, tools;
    const std::string error = error_of([&] {
      write_recording(dir.path, 1, {.worlds = 1}, true, [&](RecordingCfg& c) {
        c.video.ffmpeg_timeout = 2;
        c.video.ffmpeg =
            fake_ffmpeg(tools.path, std::string("sleep 1000 > /dev/null & echo $! > $0.left\n") +
                                        (hangs ? "sleep 1000" : "ffmpeg \"$@\""));
      });
    });
    EXPECT_THAT(error, hangs ? HasSubstr("did not finish for 2 s") : HasSubstr(""));
    EXPECT_EQ(error.empty(), !hangs) << error;
    const std::string left = read_file(tools.path / "ffmpeg.left");
    const auto ended = [file = "/proc/" + left.substr(0, left.find('\n')) + "/stat"] {
      const std::string state = read_file(file);
      return state.empty() || state.find(") Z ") != state.npos;  // it may stay as a zombie
    };
    for (int i = 0; i < 1000 && !ended(); ++i) usleep(5000);
    EXPECT_TRUE(ended()) << hangs;
  }
}

// In a process that ignores SIGCHLD the system keeps no exit status of child processes.
TEST(RecorderFaults, SigchldIsIgnored) {
  for (const bool fails : {false, true}) {
    TempDir dir, tools;
    const fs::path report = tools.path / "report";
    const pid_t pid = fork();
    if (pid == 0) {
      signal(SIGCHLD, SIG_IGN);
      const std::string error = error_of([&] {
        write_recording(dir.path, 2, {.worlds = 1}, true, [&](RecordingCfg& c) {
          if (fails) c.video.ffmpeg = fake_ffmpeg(tools.path, "cat >/dev/null; echo lost >&2");
        });
      });
      std::ofstream(report) << error << std::flush;
      _exit(0);
    }
    int status = 0;
    ASSERT_EQ(waitpid(pid, &status, 0), pid);
    if (fails) {
      EXPECT_THAT(read_file(report), AllOf(HasSubstr("ignores SIGCHLD"), HasSubstr(": lost"),
                                           ::testing::Not(HasSubstr("install"))));
    } else {
      EXPECT_EQ(read_file(report), "");
      EXPECT_THAT(tree(dir.path), ::testing::Contains(HasSubstr("batch_1_of_1.h5")));
    }
  }
}

TEST(RecorderFaults, ExistingOutput) {
  TempDir dir;
  write_recording(dir.path, 1, {});
  EXPECT_THAT(error_of([&] { write_recording(dir.path, 1, {}); }),
              AllOf(HasSubstr("already contains recorded trajectories"), HasSubstr("house_0")));
  EXPECT_THAT(error_of([&] {
                write_recording(dir.path, 2, {}, false, [](RecordingCfg& c) { c.resume = true; });
              }),
              HasSubstr("different recording: 'episodes' was 1 and is now 2"));
  TempDir other;
  write_recording(other.path, 8, {.stop_after = 1});
  EXPECT_THAT(error_of([&] { write_recording(other.path, 8, {}); }),
              HasSubstr("already contains an unfinished recording"));
}

TEST(RecorderFaults, TwoProcessesDoNotShareAHouse) {
  TempDir dir;
  FakeSuite suite(without_video(1));
  RecordingCfg cfg = fake_recording(dir.path, suite, 1, 2);
  Recorder first(cfg);
  cfg.resume = true;
  EXPECT_THAT(error_of([&] { Recorder second(cfg); }),
              HasSubstr("another process is recording into"));
}

TEST(RecorderFaults, UnwritableDirectory) {
  TempDir dir;
  std::ofstream(dir.path / "file") << "x";
  const std::string error = error_of([&] { write_recording(dir.path / "file", 1, {}); });
  EXPECT_THAT(error, AllOf(HasSubstr("cannot create the directory"), HasSubstr("Not a directory")));
}

// A full disk is simulated by a file size limit in a separate process.
TEST(RecorderFaults, DiskFull) {
  for (const bool video : {false, true}) {
    TempDir dir;
    const fs::path report = dir.path / "report";
    const pid_t pid = fork();
    if (pid == 0) {
      signal(SIGXFSZ, SIG_IGN);
      std::ofstream out(report);
      const std::string error = error_of([&] {
        FakeSuite suite({1, 320, 240, video, video});
        Recorder recorder(fake_recording(dir.path / "out", suite, 1, 1));
        const rlimit limit{20000, 20000};
        setrlimit(RLIMIT_FSIZE, &limit);
        record_all(recorder, suite, {.worlds = 1, .steps = 400});
      });
      out << error << std::flush;
      _exit(error.empty() ? 1 : 0);
    }
    int status = 0;
    waitpid(pid, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
    EXPECT_THAT(read_file(report),
                ::testing::AnyOf(HasSubstr("File too large"), HasSubstr("killed by signal")))
        << video;
    expect_nothing_published(dir.path / "out");
    EXPECT_THAT(finished_episodes(dir.path / "out/house_0"), IsEmpty());
  }
}

TEST(RecorderFaults, TruncatedTextIsRejected) {
  TempDir dir;
  FakeSuite suite(without_video(1));
  Recorder recorder(fake_recording(dir.path, suite, 1, 1));
  recorder.begin_episode(0, {});
  suite.fill(0, 0, 0, 2);
  recorder.append(0, {});
  auto row = suite.sensor("task_info").fields()[0].data.row<std::uint8_t>(0);
  std::fill(row.begin(), row.end(), 'x');  // truncated in the middle
  EXPECT_THAT(
      error_of([&] { recorder.append(0, {}); }),
      AllOf(HasSubstr("sensor 'task_info': step 1 of episode 0"), HasSubstr("str_max_len = 4000")));
  EXPECT_THAT(error_of([&] { recorder.finish_episode(0, "{}"); }), HasSubstr("was rejected"));
  recorder.discard_episode(0, "text cut");
  EXPECT_EQ(recorder.discarded(), 1);
  recorder.begin_episode(0, {1, 0});  // the next episode is recorded
  suite.fill(0, 1, 0, 1);
  recorder.append(0, {});
  recorder.finish_episode(0, "{}");
  recorder.complete();
  EXPECT_THAT(tree(dir.path), SizeIs(1));
}

TEST(RecorderFaults, InvalidCallsThrow) {
  TempDir dir;
  FakeSuite suite(without_video(2));
  Recorder recorder(fake_recording(dir.path, suite, 2, 2));
  EXPECT_THAT(error_of([&] { recorder.append(0, {}); }),
              HasSubstr("no episode has been started in world 0"));
  EXPECT_THAT(error_of([&] { recorder.begin_episode(2, {}); }),
              HasSubstr("world 2 does not exist, expected 0 to 1"));
  EXPECT_THAT(error_of([&] {
                recorder.begin_episode(0, {-1, 0});
              }),
              HasSubstr("episode -1 is before the first one, 0"));
  recorder.begin_episode(0, {0, 0});
  EXPECT_THAT(error_of([&] {
                recorder.begin_episode(0, {1, 0});
              }),
              HasSubstr("is still recording episode 0"));
  EXPECT_THAT(error_of([&] {
                recorder.begin_episode(1, {0, 0});
              }),
              HasSubstr("is already running in another world"));
  EXPECT_THAT(error_of([&] { recorder.finish_episode(0, "{}"); }), HasSubstr("has no steps"));
  suite.fill(0, 0, 0, 1);
  recorder.append(0, {});
  EXPECT_THAT(error_of([&] { recorder.finish_episode(0, "{oops"); }), HasSubstr("not JSON text"));
  EXPECT_THAT(error_of([&] { recorder.complete(); }),
              HasSubstr("world 0 is still recording episode 0"));
  recorder.finish_episode(0, "{}");
  EXPECT_THAT(error_of([&] { recorder.begin_episode(0, {0, 0}); }), HasSubstr("already recorded"));
  recorder.complete();
  EXPECT_THAT(error_of([&] { recorder.begin_episode(0, {1, 0}); }), HasSubstr("is complete"));
}

TEST(RecorderFaults, InvalidConfigurationsThrow) {
  TempDir dir;
  const auto error = [&](const std::function<void(RecordingCfg&)>& change) {
    return error_of([&] { write_recording(dir.path, 1, {}, false, change); });
  };
  EXPECT_THAT(error([](RecordingCfg& c) { c.out_dir.clear(); }), HasSubstr("no output directory"));
  EXPECT_THAT(error([](RecordingCfg& c) { c.out_dir = c.out_dir / std::string(300, 'x'); }),
              HasSubstr("x/house_0': File name too long"));
  for (const char* name : {"a\nb", "\x1b[31m"})
    EXPECT_THAT(error([&](RecordingCfg& c) { c.out_dir /= name; }),
                HasSubstr("contains control characters"));
  EXPECT_THAT(error([](RecordingCfg& c) { c.out_dir /= std::string("a\0b", 3); }),
              HasSubstr("contains control characters"));
  EXPECT_THAT(error([](RecordingCfg& c) { c.episodes = 0; }), HasSubstr("episodes is 0"));
  EXPECT_THAT(error([](RecordingCfg& c) { c.num_worlds = -1; }), HasSubstr("num_worlds is -1"));
  EXPECT_THAT(error([](RecordingCfg& c) { c.fps = {0, 1}; }), HasSubstr("fps is 0/1"));
  EXPECT_THAT(error([](RecordingCfg& c) { c.gzip = 10; }), HasSubstr("gzip is 10"));
  EXPECT_THAT(error([](RecordingCfg& c) { c.video.keyint = 0; }), HasSubstr("keyint is 0"));
  EXPECT_THAT(error([](RecordingCfg& c) { c.settings = "{"; }), HasSubstr("settings is not JSON"));
  EXPECT_THAT(tree(dir.path), IsEmpty());
}

}  // namespace
}  // namespace mjsense::record
