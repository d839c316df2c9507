// SPDX-License-Identifier: Apache-2.0
#pragma once
// Helpers for tests that write recordings and read them back.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/record/recorder.h"
#include "mjsense/record/testing/fake_suite.h"

namespace mjsense::testing {

namespace fs = std::filesystem;

inline std::string read_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

// Relative paths of all files below `dir`, sorted.
inline std::vector<std::string> tree(const fs::path& dir) {
  std::vector<std::string> names;
  for (const auto& e : fs::recursive_directory_iterator(dir)) {
    if (e.is_regular_file()) names.push_back(e.path().lexically_relative(dir).string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

// Creates an executable script that replaces ffmpeg. `body` finds the output file in $out and can
// run the real program with the given arguments as `ffmpeg "$@"`. The script itself answers the
// query for encoders.
inline std::string fake_ffmpeg(const fs::path& dir, const std::string& body) {
  const fs::path path = dir / "ffmpeg";
  std::ofstream(path) << "#!/bin/sh\n"
                         "case \"$*\" in *-encoders*) echo ' V libx264 x'; echo ' V ffv1 x'; echo "
                         "' V libx264rgb x'; exit 0;; esac\n"
                         "for out; do :; done\n"
                         "out=${out#file:}\n"
                      << body << "\n";
  fs::permissions(path, fs::perms::owner_all);
  return path.string();
}

struct Attempts {
  int worlds = 2;
  int steps = 6;
  int discard_every = 0;  // discards every n-th attempt; 0: none
  int stop_after = -1;  // decided attempts after which the recorder is destroyed without complete()
};

inline int length_of(std::int64_t episode, int steps) {
  return steps + static_cast<int>(episode % 3);
}

// Runs attempts in order, like a rollout, until the recording has enough episodes.
inline void record_all(record::Recorder& recorder, record::FakeSuite& suite, const Attempts& a) {
  struct Running {
    std::int64_t episode = -1;
    int t = 0;
  };
  std::vector<Running> running(a.worlds);
  std::int64_t next = recorder.first_attempt();
  for (int decided = 0; !recorder.has_all_episodes();) {
    for (int w = 0; w < a.worlds && !recorder.has_all_episodes(); ++w) {
      Running& r = running[w];
      if (r.episode < 0) {
        while (recorder.decided(next)) ++next;
        r = {next++, 0};
        recorder.begin_episode(w, {r.episode, 7});
      }
      const int T = length_of(r.episode, a.steps);
      suite.fill(w, r.episode, r.t, T);
      const bool last = ++r.t == T;
      recorder.append(w, {0.5f * static_cast<float>(r.t), last, false, last});
      if (!last) continue;
      if (a.discard_every > 0 && r.episode % a.discard_every == a.discard_every - 1) {
        recorder.discard_episode(w, "for the test");
      } else {
        recorder.finish_episode(w, record::FakeSuite::obs_scene(r.episode), "success");
      }
      r.episode = -1;
      if (++decided == a.stop_after) {
        recorder.flush();
        return;
      }
    }
  }
  for (int w = 0; w < a.worlds; ++w) {
    if (recorder.recording(w)) recorder.abandon_episode(w);
  }
  recorder.complete();
}

inline record::FakeSuiteCfg without_video(int worlds) { return {worlds, 16, 12, false, false}; }

inline record::RecordingCfg fake_recording(const fs::path& out, const record::FakeSuite& suite,
                                           int worlds, int episodes) {
  record::RecordingCfg cfg;
  cfg.out_dir = out;
  cfg.episodes = episodes;
  cfg.num_worlds = worlds;
  cfg.fps = record::Fps::from_period_ms(66);
  cfg.sensors = suite.sensors();
  cfg.settings = R"({"seed":7})";
  return cfg;
}

// Records and returns the bytes of all HDF5 files, in order.
inline std::string write_recording(const fs::path& out, int episodes, const Attempts& attempts,
                                   bool video = false,
                                   const std::function<void(record::RecordingCfg&)>& change = {}) {
  record::FakeSuite suite({attempts.worlds, 16, 12, video, video});
  record::RecordingCfg cfg = fake_recording(out, suite, attempts.worlds, episodes);
  if (change) change(cfg);
  {
    record::Recorder recorder(cfg);
    record_all(recorder, suite, attempts);
  }
  std::string bytes;
  for (const std::string& name : tree(out)) bytes += read_file(out / name);
  return bytes;
}

}  // namespace mjsense::testing
