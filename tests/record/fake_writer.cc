// SPDX-License-Identifier: Apache-2.0
// Program that records a suite without physics. The Python tests read, kill and resume its
// recordings.
//   record_fake OUT [--episodes N] [--worlds B] [--steps T] [--batches n] [--discard K]
//               [--width W] [--height H] [--cameras C] [--no-video] [--no-depth] [--red-green]
//               [--encoders E] [--threads n] [--gzip G] [--timeout S] [--resume]
//               [--step-ms MS] [--stop-after N] [--print] [--measure] [--carry FILE.h5]
//   record_fake verify PATH [decode]
//   record_fake repair|inspect PATH
//   record_fake sheet PATH PNG
// Every K-th attempt is discarded (0: none). --print prints "finished E" after each episode that
// is stored on disk; --measure prints the duration of the recording. --carry adds to every episode
// the data of traj_0 of a recording's file that it does not have.

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <thread>

#include "mjsense/core/error.h"
#include "mjsense/record/recorder.h"
#include "mjsense/record/sha256.h"
#include "mjsense/record/testing/fake_suite.h"
#include "mjsense/replay/recording_tools.h"

using namespace mjsense;

namespace {

struct Options {
  std::map<std::string, std::string> values;
  int number(const std::string& key, int otherwise) const {
    const auto at = values.find(key);
    return at == values.end() ? otherwise : std::atoi(at->second.c_str());
  }
  bool flag(const std::string& key) const { return values.contains(key); }
  std::string text(const std::string& key) const {
    return flag(key) ? values.at(key) : std::string();
  }
};

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 2; i < argc; ++i) {
    const std::string key = argv[i];
    const bool has_value = i + 1 < argc && std::strncmp(argv[i + 1], "--", 2) != 0;
    options.values[key] = has_value ? argv[++i] : "";
  }
  return options;
}

// Rows of one episode, created before the time measurement, which covers only the recorder.
class Rows {
 public:
  Rows(record::FakeSuite& suite, int steps) : suite_(suite) {
    for (int t = 0; t < steps; ++t) {
      suite.fill(0, 0, t, steps);
      std::vector<std::byte>& row = rows_.emplace_back();
      for (const Sensor* sensor : suite.sensors()) {
        for (const Field& f : sensor->fields())
          row.insert(row.end(), f.data.row_data(0), f.data.row_data(0) + f.data.row_bytes());
      }
    }
  }

  void fill(int world, int t) {
    const std::byte* from = rows_[t].data();
    for (const Sensor* sensor : suite_.sensors()) {
      for (const Field& f : sensor->fields()) {
        std::memcpy(const_cast<std::byte*>(f.data.row_data(world)), from, f.data.row_bytes());
        from += f.data.row_bytes();
      }
    }
  }

 private:
  record::FakeSuite& suite_;
  std::vector<std::vector<std::byte>> rows_;
};

// Data for replay that do not depend on the step.
std::vector<record::EpisodeArray> replay_arrays(std::int64_t episode) {
  std::vector<double> sizes(300, std::numeric_limits<double>::quiet_NaN());
  sizes[episode % 300] = 0.02;
  const auto bytes = std::as_bytes(std::span(sizes));
  record::EpisodeArray sizes_of_geoms;
  sizes_of_geoms.path = "model/geom_size";
  sizes_of_geoms.description =
      "Values of this episode's model; NaN: the value of the archived model.";
  sizes_of_geoms.shape = {100, 3};
  sizes_of_geoms.values = {bytes.begin(), bytes.end()};
  return {sizes_of_geoms};
}

struct Running {
  std::int64_t episode = -1;
  int t = 0;
};

int write_recording(const std::string& out, const Options& o) {
  const int worlds = o.number("--worlds", 2), steps = o.number("--steps", 20),
            discard = o.number("--discard", 0);
  const bool video = !o.flag("--no-video");
  record::FakeSuite suite({worlds, o.number("--width", 64), o.number("--height", 48), video,
                           video && !o.flag("--no-depth"), o.number("--cameras", 1)});
  record::RecordingCfg cfg;
  cfg.out_dir = out;
  cfg.episodes = o.number("--episodes", 4);
  cfg.batches = o.number("--batches", 0);
  cfg.num_worlds = worlds;
  cfg.fps = record::Fps::from_period_ms(66);
  cfg.sensors = suite.sensors();
  cfg.settings = R"({"task": "fake", "seed": 0})";
  cfg.archive = std::string(5000, 'a');  // stands for a ZIP archive of a model
  record::Sha256 sum;
  sum.add(cfg.archive.data(), cfg.archive.size());
  cfg.archive_name = record::archive_name(sum.text());
  cfg.resume = o.flag("--resume");
  cfg.gzip = o.number("--gzip", 4);
  cfg.video.max_encoders = o.number("--encoders", 0);
  cfg.video.threads = o.number("--threads", 1);
  cfg.video.molmospaces_depth = o.flag("--red-green");
  if (o.flag("--timeout")) cfg.video.ffmpeg_timeout = o.number("--timeout", 60);
  record::Recorder recorder(cfg);
  const record::EpisodeSource source{o.text("--carry"), "traj_0", {"obs/sensor_data"}};

  const bool measure = o.flag("--measure");
  std::optional<Rows> rows;
  if (measure) rows.emplace(suite, steps);
  const auto start = std::chrono::steady_clock::now();
  const auto rejected = [&](std::int64_t e) { return discard > 0 && e % discard == discard - 1; };
  // Episodes have different lengths, unless time is measured.
  const auto length = [&](std::int64_t e) {
    return measure ? steps : steps + static_cast<int>(e % 3);
  };
  std::vector<Running> running(worlds);
  std::int64_t next = 0;
  int finished = 0;
  while (true) {
    bool any = false;
    for (int w = 0; w < worlds; ++w) {
      Running& r = running[w];
      if (recorder.has_all_episodes()) {
        if (recorder.recording(w)) recorder.abandon_episode(w);
        continue;
      }
      if (r.episode < 0) {
        while (recorder.decided(next)) ++next;
        r = {next++, 0};
        recorder.begin_episode(w, {r.episode, 1000u + static_cast<std::uint64_t>(r.episode)});
      }
      any = true;
      const int T = length(r.episode);
      if (measure) {
        rows->fill(w, r.t);
      } else {
        suite.fill(w, r.episode, r.t, T);
      }
      const bool last = r.t + 1 == T;
      recorder.append(w, {0.25f * static_cast<float>(r.t), last, false, last});
      if (o.flag("--step-ms"))
        std::this_thread::sleep_for(std::chrono::milliseconds(o.number("--step-ms", 0)));
      ++r.t;
      if (!last) continue;
      if (rejected(r.episode)) {
        recorder.discard_episode(w, "every so many");
      } else {
        if (!source.file.empty()) recorder.carry_over(w, source);
        recorder.finish_episode(
            w, record::FakeSuite::obs_scene(r.episode), "success",
            source.file.empty() ? replay_arrays(r.episode) : std::vector<record::EpisodeArray>());
        if (o.flag("--print")) {
          recorder.flush();
          fmt::print("finished {}\n", r.episode);
          std::fflush(stdout);
        }
      }
      r.episode = -1;
      if (++finished == o.number("--stop-after", -1)) return 0;
    }
    if (!any) break;
  }
  recorder.complete();
  if (measure) {
    const double wall =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const record::RecordStats s = recorder.stats();
    fmt::print(
        R"({{"wall_s":{},"rows":{},"frames":{},"raw_bytes":{},"disk_bytes":{},"copy_s":{},"wait_s":{},"write_s":{},"commit_s":{},)"
        R"("encode_cpu_s":{},"bytes_per_world":{}}})"
        "\n",
        wall, s.rows, s.frames, s.raw_bytes, s.published_bytes, s.copy_s, s.wait_s, s.write_s,
        s.commit_s, s.encode_cpu_s, recorder.bytes_per_world());
  }
  return 0;
}

int look(const std::string& command, const std::string& path, const std::string& png) {
  if (command == "verify") {
    const replay::VerifyResult result = replay::verify(path, {.decode = png == "decode"});
    fmt::print("{}", result.text());
    return result.ok() ? 0 : 1;
  }
  if (command == "repair") fmt::print("{}", replay::repair(path).text());
  if (command == "inspect") fmt::print("{}", replay::inspect(path).text());
  if (command == "sheet") replay::contact_sheet(path, png);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  try {
    if (argc > 2 && argv[2][0] != '-') return look(argv[1], argv[2], argc > 3 ? argv[3] : "");
    return write_recording(argv[1], parse(argc, argv));
  } catch (const Error& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  }
}
