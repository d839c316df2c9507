// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/parallel.h"
#include "mjsense/record/house.h"
#include "mjsense/record/layout.h"
#include "mjsense/replay/check.h"
#include "mjsense/replay/json_text.h"
#include "mjsense/replay/trajectory.h"
#include "mjsense/replay/video_probe.h"

namespace fs = std::filesystem;

namespace mjsense {
namespace {

struct VideoCheck {
  std::string place;
  fs::path path;
  std::int64_t frames = 0;
  std::int64_t width = 0, height = 0;  // 0: not stated
};

class Verifier {
 public:
  explicit Verifier(const VerifyOptions& options) : options_(options) {}

  VerifyResult run(const fs::path& path) {
    for (const RecordedFile& file : recorded_files(path)) check_file(file);
    check_videos();
    for (const fs::path& house : recorded_houses(path)) {
      if (fs::is_directory(path)) check_leftovers(house);
    }
    return std::move(result_);
  }

 private:
  void error(const std::string& place, std::string text) {
    result_.findings.push_back({true, place, std::move(text)});
  }
  void note(const std::string& place, std::string text) {
    result_.findings.push_back({false, place, std::move(text)});
  }

  void check_file(const RecordedFile& recorded) {
    (recorded.published ? result_.files : result_.unpublished) += 1;
    const h5::H5Lock lock;
    try {
      const h5::Id file = h5::open_file(recorded.path);
      const std::vector<std::string> names = trajectory_names(file);
      if (names.empty()) error(recorded.name, "holds no trajectory");
      for (std::size_t i = 0; i < names.size(); ++i) {
        if (names[i] != fmt::format("traj_{}", i)) {
          error(recorded.name,
                fmt::format("trajectory {} is named '{}', expected 'traj_{}'", i, names[i], i));
        }
        const h5::Id trajectory(H5Gopen2(file, names[i].c_str(), H5P_DEFAULT), H5Gclose, names[i]);
        check_trajectory(trajectory, recorded, recorded.name + " " + names[i]);
      }
    } catch (const Error& e) {
      error(recorded.name, e.what());
    }
  }

  void check_trajectory(hid_t trajectory, const RecordedFile& recorded, const std::string& place) {
    ++result_.episodes;
    if (!h5::exists(trajectory, "success"))
      return error(place, "has no 'success': its length is unknown");
    const std::int64_t T = RowDataset(trajectory, "success").rows();
    result_.steps += static_cast<int>(T);
    if (T == 0) error(place, "has no steps");
    for (const char* name : {"rewards", "fail", "terminated", "truncated", "obs_scene"}) {
      if (!h5::exists(trajectory, name)) error(place, fmt::format("has no '{}'", name));
    }
    visit_datasets(trajectory, [&](const std::string& name) {
      if (name.starts_with("obs/sensor_data/")) return;
      try {
        check_dataset(trajectory, name, T, place + "/" + name);
      } catch (const Error& e) {
        error(place + "/" + name, e.what());
      }
    });
    check_success(trajectory, place);
    for (const char* name : {"obs/agent/qpos", "obs/agent/qvel"}) {
      if (!h5::exists(trajectory, name))
        note(place, fmt::format("has no '{}', which MolmoSpaces' tools ask for", name));
    }
    check_sensor_data(trajectory, recorded, T, place);
  }

  void check_dataset(hid_t trajectory, const std::string& name, std::int64_t T,
                     const std::string& place) {
    const RowDataset dataset(trajectory, name);
    if (name == "obs_scene") {
      if (const auto wrong = parse_json(h5::read_text(trajectory, name)); !wrong.empty())
        error(place, "is no JSON text: " + wrong);
      return;
    }
    if (dataset.scalar() || dataset.rows() != T) {
      return error(
          place, fmt::format("has {} rows, expected {}", dataset.scalar() ? 0 : dataset.rows(), T));
    }
    if (dataset.is_json()) {
      int bad = 0;
      dataset.each_text([&](std::int64_t t, std::string_view text) {
        const std::string wrong = parse_json(text);
        if (!wrong.empty() && bad++ == 0)
          error(place, fmt::format("row {} is no JSON text: {}", t, wrong));
      });
      if (bad > 1) error(place, fmt::format("{} rows are no JSON text", bad));
    } else if (dataset.is_number()) {
      dataset.each_number([](std::span<const double>) {});  // that every chunk can be read
    }
  }

  void check_success(hid_t trajectory, const std::string& place) {
    if (!h5::exists(trajectory, "fail")) return;
    std::vector<double> success, fail;
    RowDataset(trajectory, "success").each_number([&](auto v) {
      success.insert(success.end(), v.begin(), v.end());
    });
    RowDataset(trajectory, "fail").each_number([&](auto v) {
      fail.insert(fail.end(), v.begin(), v.end());
    });
    for (std::size_t t = 0; t < std::min(success.size(), fail.size()); ++t) {
      if (success[t] + fail[t] != 1)
        return error(place + "/fail", fmt::format("row {} is not the opposite of success", t));
    }
  }

  void check_sensor_data(hid_t trajectory, const RecordedFile& recorded, std::int64_t T,
                         const std::string& place) {
    std::set<std::string> named;
    if (h5::exists(trajectory, "obs/sensor_data")) {
      const h5::Id group(H5Gopen2(trajectory, "obs/sensor_data", H5P_DEFAULT), H5Gclose,
                         "obs/sensor_data");
      for (const std::string& key : h5::children(group)) {
        named.insert(key);
        const h5::Id dataset(H5Dopen2(group, key.c_str(), H5P_DEFAULT), H5Dclose, key);
        VideoCheck video{place + "/obs/sensor_data/" + key,
                         recorded.path.parent_path() / read_file_name(group, key), T};
        video.width = h5::int_attribute(dataset, "width", 0);
        video.height = h5::int_attribute(dataset, "height", 0);
        used_.insert(video.path);
        videos_.push_back(std::move(video));
      }
    }
    if (!h5::text_attribute(trajectory, "outcome").empty() ||
        !h5::exists(trajectory, "obs/sensor_param"))
      return;
    const h5::Id params(H5Gopen2(trajectory, "obs/sensor_param", H5P_DEFAULT), H5Gclose,
                        "obs/sensor_param");
    for (const std::string& camera : h5::children(params)) {
      if (!named.contains(camera))
        note(place, fmt::format("names no video of camera '{}' (repair adds the names)", camera));
    }
  }

  void check_videos() {
    result_.videos = static_cast<int>(videos_.size());
    std::vector<std::string> wrong(videos_.size());
    ThreadPool pool(0);
    pool.run(static_cast<int>(videos_.size()),
             [&](int i, int) { wrong[i] = check_video(videos_[i]); });
    for (std::size_t i = 0; i < videos_.size(); ++i) {
      if (!wrong[i].empty()) error(videos_[i].place, wrong[i]);
    }
  }

  std::string check_video(const VideoCheck& video) const {
    const std::string name = video.path.filename().string();
    if (!fs::is_regular_file(video.path)) return fmt::format("'{}' does not exist", name);
    const VideoProbe probe = probe_video(video.path, options_.decode, options_.ffmpeg);
    if (!probe.error.empty()) return fmt::format("'{}' cannot be read: {}", name, probe.error);
    if (probe.frames != video.frames)
      return fmt::format("'{}' has {} frames, expected {}", name, probe.frames, video.frames);
    // 4:2:0 videos of odd pictures have one more column or row.
    const auto fits = [](int got, std::int64_t stated) {
      return stated == 0 || got == stated || got == (stated + 1) / 2 * 2;
    };
    if (fits(probe.width, video.width) && fits(probe.height, video.height)) return "";
    return fmt::format("'{}' is {} x {} pixels, expected {} x {}", name, probe.width, probe.height,
                       video.width, video.height);
  }

  void check_leftovers(const fs::path& house) {
    const std::string place = house.filename().string();
    if (fs::exists(house / kStagingDir)) {
      const std::size_t waiting = finished_episodes(house).size();
      error(place, fmt::format("is unfinished: {} finished episodes wait to be published; resume "
                               "the recording, or repair",
                               waiting));
      return;  // an interrupted publication may have moved videos already
    }
    for (const fs::directory_entry& entry : fs::directory_iterator(house)) {
      const fs::path& path = entry.path();
      const bool video = path.extension() == ".mp4" || path.extension() == ".mkv";
      if (video && !used_.contains(path))
        note(place + "/" + path.filename().string(), "belongs to no episode");
    }
  }

  VerifyOptions options_;
  VerifyResult result_;
  std::vector<VideoCheck> videos_;
  std::set<fs::path> used_;
};

}  // namespace

VerifyResult verify(const fs::path& path, const VerifyOptions& options) {
  return Verifier(options).run(path);
}

bool VerifyResult::ok() const {
  return std::none_of(findings.begin(), findings.end(), [](const Finding& f) { return f.error; });
}

std::string VerifyResult::text() const {
  std::string out;
  for (const Finding& f : findings)
    out += fmt::format("{}: {} {}\n", f.error ? "error" : "note", f.place, f.text);
  out += fmt::format("{}: {} files, {} episodes, {} steps, {} videos", ok() ? "whole" : "NOT whole",
                     files, episodes, steps, videos);
  if (unpublished > 0) out += fmt::format(", {} episodes not published", unpublished);
  return out + "\n";
}

std::string VerifyResult::json() const {
  nlohmann::json j{{"ok", ok()},     {"files", files},   {"episodes", episodes},
                   {"steps", steps}, {"videos", videos}, {"unpublished", unpublished}};
  j["findings"] = nlohmann::json::array();
  for (const Finding& f : findings)
    j["findings"].push_back({{"error", f.error}, {"place", f.place}, {"text", f.text}});
  return j.dump(2);
}

}  // namespace mjsense
