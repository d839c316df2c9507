// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/recording_description.h"
#include "mjsense/record/recording_folder.h"
#include "mjsense/record/recording_lock.h"
#include "mjsense/record/sha256.h"
#include "mjsense/record/video_file.h"
#include "mjsense/replay/json_text.h"
#include "mjsense/replay/recording_tools.h"
#include "mjsense/replay/trajectory.h"
#include "mjsense/replay/video_probe.h"

namespace fs = std::filesystem;

namespace mjsense::replay {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t kMaxSteps = 10'000'000;  // per episode: a week at 15 Hz
constexpr std::size_t kMaxFindings = 200;       // per file
// A file whose rows are more than this many times its own size is taken for a decompression bomb.
constexpr std::uint64_t kMaxUnpacked = 200, kFreeBytes = std::uint64_t{1} << 30;

constexpr const char* kChanged = "changed while it was being read: verify it again";

struct VideoCheck {
  std::string context;
  fs::path folder;
  std::string name;
  std::int64_t frames = 0;
  std::int64_t width = 0, height = 0;  // 0: unknown
  std::string crc;                     // "" if unknown
};

// Verifies one file in a separate process. The result is returned as JSON text.
class FileVerifier {
 public:
  FileVerifier(const RecordedFile& recorded, std::uint64_t bytes, bool sealed)
      : recorded_(recorded), bytes_(bytes), sealed_(sealed) {}

  std::string run() {
    try {
      check_file();
    } catch (const Error& e) {
      error(recorded_.name, e.what());
    }
    out_["episodes"] = episodes_;
    out_["steps"] = steps_;
    return out_.dump(-1, ' ', false, Json::error_handler_t::replace);
  }

 private:
  void add(bool is_error, const std::string& context, const std::string& text) {
    if (++findings_ == kMaxFindings)
      return out_["findings"].push_back(
          {is_error, recorded_.name, "has further findings, which are not listed"});
    if (findings_ < kMaxFindings)
      out_["findings"].push_back({is_error, printable(context), printable(text)});
  }
  void error(const std::string& context, const std::string& text) { add(true, context, text); }
  void note(const std::string& context, const std::string& text) { add(false, context, text); }

  void check_file() {
    const hdf5::H5Lock lock;
    const hdf5::Id file = hdf5::open_file(recorded_.path);
    haddr_t end = 0;
    if (!sealed_ && H5Fget_eoa(file, &end) >= 0 && end < bytes_)
      error(recorded_.name, fmt::format("has {} bytes after its end", bytes_ - end));
    ours_ = hdf5::has_attribute(file, "recording");
    if (ours_) check_description(hdf5::text_attribute(file, "recording"));
    const std::vector<std::string> names = trajectory_names(file);
    if (names.empty()) error(recorded_.name, "contains no trajectory");
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string context = recorded_.name + " " + names[i];
      if (names[i] != fmt::format("traj_{}", i)) {
        error(recorded_.name,
              fmt::format("trajectory {} is named '{}', expected 'traj_{}'", i, names[i], i));
      }
      try {
        check_trajectory(hdf5::open_group(file, names[i]), context);
      } catch (const Error& e) {
        error(context, e.what());
      }
    }
    if (ours_ && without_sum_ > 0) {
      note(recorded_.name,
           fmt::format("has no checksums of {} datasets and videos: {}", without_sum_,
                       with_sum_ > 0 ? "they were changed or added later"
                                     : "recorded by a version that stored none"));
    } else if (ours_ && !sealed_) {
      note(recorded_.name,
           "was changed since it was recorded: it has no checksum of the whole file");
    }
  }

  void check_description(const std::string& text) {
    const Json description = record::parse_description(text);
    if (!description.is_object())
      return error(recorded_.name, "has a description of the recording that cannot be read");
    const auto archive = description.find("model_archive");
    if (archive == description.end()) return;
    if (!archive->is_string())
      return error(recorded_.name, "has a description whose model_archive is not a file name");
    out_["archive"] = *archive;
  }

  void check_trajectory(hid_t trajectory, const std::string& context) {
    ++episodes_;
    if (!hdf5::exists(trajectory, "success"))
      return error(context, "has no 'success': its length is unknown");
    const RowDataset success(trajectory, "success");
    if (!success.is_number() || success.row_size() != 1)
      return error(context, "has a 'success' that is not a one-dimensional array of booleans");
    const std::int64_t T = success.rows();
    if (T > kMaxSteps) return error(context, fmt::format("declares {} steps", T));
    steps_ += T;
    if (T == 0) error(context, "has no steps");
    for (const char* name : {"rewards", "fail", "terminated", "truncated", "obs_scene"}) {
      if (!hdf5::exists(trajectory, name)) error(context, fmt::format("has no '{}'", name));
    }
    hdf5::each_dataset(trajectory, [&](const std::string& name) {
      if (name.starts_with("obs/sensor_data/")) return;
      try {
        check_dataset(trajectory, name, T, context + "/" + name);
      } catch (const Error& e) {
        error(context + "/" + name, e.what());
      }
    });
    check_success(trajectory, context);
    for (const char* name : {"obs/agent/qpos", "obs/agent/qvel"}) {
      if (!hdf5::exists(trajectory, name))
        note(context, fmt::format("has no '{}', which MolmoSpaces' tools require", name));
    }
    check_sensor_data(trajectory, T, context);
  }

  // Compares with the checksum stored in the object's attribute.
  void compare(hid_t object, const std::string& context, const record::Checksum& sum) {
    const std::string stated = hdf5::text_attribute(object, record::kChecksumAttribute);
    ++(stated.empty() ? without_sum_ : with_sum_);
    if (!stated.empty() && stated != sum.text())
      error(context, fmt::format("differs from what was recorded: its checksum is {}, expected {}",
                                 sum.text(), stated));
  }

  void check_dataset(hid_t trajectory, const std::string& name, std::int64_t T,
                     const std::string& context) {
    const RowDataset dataset(trajectory, name);
    unpacked_ += dataset.bytes();
    if (unpacked_ > kFreeBytes + kMaxUnpacked * bytes_)
      return error(context, "is not read: the file declares far more data than it contains");
    record::Checksum sum;
    if (name == "obs_scene") {
      const std::string text = hdf5::read_text(trajectory, name);
      if (const auto wrong = parse_json(text); !wrong.empty())
        error(context, "is not JSON text: " + wrong);
      sum.add(text.data(), text.size());
      return compare(dataset.id(), context, sum);
    }
    const bool every_step = !name.starts_with("replay/model/") && name != "replay/held";
    if (every_step && (dataset.scalar() || dataset.rows() != T)) {
      return error(context, fmt::format("has {} rows, expected {}",
                                        dataset.scalar() ? 0 : dataset.rows(), T));
    }
    if (dataset.is_json()) {
      int bad = 0;
      dataset.each_text([&](std::int64_t t, std::string_view text) {
        const std::string wrong = parse_json(text);
        if (!wrong.empty() && bad++ == 0)
          error(context, fmt::format("row {} is not JSON text: {}", t, wrong));
      });
      if (bad > 1) error(context, fmt::format("{} rows are not JSON text", bad));
    }
    if (!dataset.is_number()) {
      if (ours_) error(context, fmt::format("is {}, which is never recorded", dataset.dtype()));
      return;
    }
    dataset.each_bytes([&](std::string_view bytes) { sum.add(bytes.data(), bytes.size()); });
    compare(dataset.id(), context, sum);
    if (ours_ && dataset.dtype().starts_with("float")) check_nan(dataset, context);
  }

  // A stream may hold NaN if its description says what that means.
  void check_nan(const RowDataset& dataset, const std::string& context) {
    if (hdf5::text_attribute(dataset.id(), "description").find("NaN") != std::string::npos) return;
    std::int64_t at = 0, first = -1, count = 0;
    dataset.each_number([&](std::span<const double> values) {
      for (const double x : values) {
        if (std::isnan(x) && count++ == 0) first = at;
        ++at;
      }
    });
    if (count > 0) {
      error(context, fmt::format("holds {} NaN, the first in row {}, and its description does not "
                                 "say what NaN means",
                                 count, first / dataset.row_size()));
    }
  }

  void check_success(hid_t trajectory, const std::string& context) {
    if (!hdf5::exists(trajectory, "fail")) return;
    std::vector<std::int8_t> success, fail;
    const auto read = [&](const char* name, std::vector<std::int8_t>& out) {
      const RowDataset dataset(trajectory, name);
      if (!dataset.is_number())
        return error(context + "/" + name, fmt::format("is {}, expected bool", dataset.dtype()));
      if (dataset.rows() > kMaxSteps || dataset.row_size() != 1) return;
      dataset.each_number([&](auto v) {
        for (const double x : v) out.push_back(x == 0 ? 0 : x == 1 ? 1 : 2);
      });
    };
    read("success", success);
    read("fail", fail);
    for (std::size_t t = 0; t < std::min(success.size(), fail.size()); ++t) {
      if (success[t] + fail[t] != 1)
        return error(context + "/fail", fmt::format("row {} is not the opposite of success", t));
    }
  }

  void check_sensor_data(hid_t trajectory, std::int64_t T, const std::string& context) {
    std::set<std::string> named;
    if (hdf5::exists(trajectory, "obs/sensor_data")) {
      const hdf5::Id group = hdf5::open_group(trajectory, "obs/sensor_data");
      for (const std::string& key : hdf5::children(group)) {
        named.insert(key);
        const std::string video_place = fmt::format("{}/obs/sensor_data/{}", context, key);
        try {
          const hdf5::Id dataset = hdf5::open_dataset(group, key);
          const std::string crc = hdf5::text_attribute(dataset, record::kChecksumAttribute);
          ++(crc.empty() ? without_sum_ : with_sum_);
          out_["videos"].push_back({{"place", printable(video_place)},
                                    {"name", read_file_name(group, key)},
                                    {"frames", T},
                                    {"width", hdf5::int_attribute(dataset, "width", 0)},
                                    {"height", hdf5::int_attribute(dataset, "height", 0)},
                                    {"crc", crc}});
        } catch (const Error& e) {
          error(video_place, e.what());
        }
      }
    }
    if (!hdf5::text_attribute(trajectory, "outcome").empty() ||
        !hdf5::exists(trajectory, "obs/sensor_param"))
      return;
    for (const std::string& camera :
         hdf5::children(hdf5::open_group(trajectory, "obs/sensor_param"))) {
      if (!named.contains(camera))
        note(context, fmt::format("names no video of camera '{}' (repair adds the names)", camera));
    }
  }

  const RecordedFile& recorded_;
  std::uint64_t bytes_;
  bool sealed_;
  Json out_{{"findings", Json::array()}, {"videos", Json::array()}};
  std::size_t findings_ = 0;
  bool ours_ = false;
  int episodes_ = 0, without_sum_ = 0, with_sum_ = 0;
  std::int64_t steps_ = 0;
  std::uint64_t unpacked_ = 0;
};

class Verifier {
 public:
  explicit Verifier(const VerifyOptions& options) : options_(options) {}

  VerifyResult run(const fs::path& path) {
    listed_ = recorded_files(path);
    for (std::size_t i = 0; i < listed_.size(); ++i) {
      check_file(listed_[i]);
      if (options_.progress)
        options_.progress(fmt::format("{} of {} files", i + 1, listed_.size()));
    }
    check_videos();
    for (const auto& [folder, name] : archives_) check_archive(folder, name);
    for (const fs::path& house : recorded_houses(path)) {
      if (fs::is_directory(path)) check_leftovers(house);
    }
    return std::move(result_);
  }

 private:
  void error(const std::string& context, const std::string& text) {
    result_.findings.push_back({true, printable(context), printable(text)});
  }
  void note(const std::string& context, const std::string& text) {
    result_.findings.push_back({false, printable(context), printable(text)});
  }

  void check_file(const RecordedFile& recorded) {
    (recorded.published ? result_.files : result_.unpublished) += 1;
    try {
      const fs::path folder = recorded.path.parent_path();
      if (!recorded.published && !is_plain_folder(folder))
        return error(recorded.name, "is in a symbolic link, which is not followed");
      const Fd file = open_plain(folder, recorded.path.filename().string());
      const FileState before = state_of(file);
      const auto bytes = static_cast<std::uint64_t>(size_of(file));
      const record::Seal seal = record::check_seal(file.get());
      std::string answer, failure;
      try {
        answer = hdf5::in_child(recorded.name, bytes, [&] {
          return FileVerifier(recorded, bytes, seal != record::Seal::kNone).run();
        });
      } catch (const Error& e) {
        failure = e.what();
      }
      if (state_of(recorded.path) != before) return error(recorded.name, kChanged);
      if (seal == record::Seal::kCorrupt) error(recorded.name, "is damaged: its checksum is wrong");
      if (!failure.empty()) return error(recorded.name, failure);
      take(recorded, Json::parse(answer));
    } catch (const Json::exception&) {
      error(recorded.name, "is damaged: the process that read it returned nothing");
    } catch (const Error& e) {
      error(recorded.name, e.what());
    }
  }

  void take(const RecordedFile& recorded, const Json& found) {
    if (recorded.published && found.contains("archive"))
      archives_.emplace(recorded.path.parent_path(), found.at("archive").get<std::string>());
    result_.episodes += found.at("episodes").get<int>();
    result_.steps += static_cast<int>(std::min<std::int64_t>(
        found.at("steps").get<std::int64_t>(), std::numeric_limits<int>::max() - result_.steps));
    for (const Json& f : found.at("findings"))
      result_.findings.push_back({f.at(0), f.at(1), f.at(2)});
    for (const Json& v : found.at("videos")) {
      VideoCheck video{v.at("place"), recorded.path.parent_path(),
                       v.at("name"),  v.at("frames"),
                       v.at("width"), v.at("height"),
                       v.at("crc")};
      if (used_.insert(video.folder / video.name).second) {
        videos_.push_back(std::move(video));
      } else {
        error(video.context, fmt::format("'{}' is also the video of another episode", video.name));
      }
    }
  }

  // The name of a model archive contains the start of its SHA-256, model_1a2b3c4d5e6f.zip, and in
  // earlier recordings its CRC-32, model_1a2b3c4d.zip.
  void check_archive(const fs::path& folder, const std::string& name) {
    const std::string context = folder.filename().string();
    if (!is_plain_name(name))
      return error(context,
                   fmt::format("names a model archive '{}', which is not a plain file name", name));
    try {
      const Fd file = open_plain(folder, name);
      const std::string crc = fmt::format("model_{}.zip", record::checksum_of(file.get()));
      const std::string expected =
          name.size() == crc.size() ? crc : record::archive_name(record::sha256_of(file.get()));
      if (name != expected)
        error(context,
              fmt::format("'{}' is damaged: its checksum is that of '{}'", name, expected));
    } catch (const Error& e) {
      error(context, fmt::format("the model archive, which replay needs: {}", e.what()));
    }
  }

  void check_videos() {
    result_.videos = static_cast<int>(videos_.size());
    std::vector<std::string> wrong(videos_.size());
    ThreadPool pool(0);
    std::mutex counting;
    int done = 0;
    pool.run(static_cast<int>(videos_.size()), [&](int i, int) {
      wrong[i] = check_video(videos_[i]);
      const std::scoped_lock lock(counting);
      ++done;
      if (options_.progress)
        options_.progress(fmt::format("{} of {} videos", done, videos_.size()));
    });
    for (std::size_t i = 0; i < videos_.size(); ++i) {
      if (!wrong[i].empty()) error(videos_[i].context, wrong[i]);
    }
  }

  std::string check_video(const VideoCheck& video) const {
    Fd file;
    try {
      file = open_plain(video.folder, video.name);
      const FileState before = state_of(file);
      std::string wrong = check_video(video, file);
      if (!wrong.empty() && state_of(video.folder / video.name) != before)
        wrong = fmt::format("'{}' {}", video.name, kChanged);
      return wrong;
    } catch (const Error& e) {
      return e.what();
    }
  }

  std::string check_video(const VideoCheck& video, const Fd& file) const {
    record::VideoFacts facts = record::read_video_facts(file.get());
    // Video containers written by other programs may have a format that only ffmpeg can read.
    if (!facts.error.empty() || options_.decode) {
      const VideoProbe probe =
          probe_video(video.folder / video.name, options_.decode, video.frames, options_.ffmpeg);
      if (!probe.error.empty())
        return fmt::format("'{}' cannot be read: {}", video.name, probe.error);
      facts = {probe.frames, probe.width, probe.height, ""};
    }
    if (facts.frames != video.frames)
      return fmt::format("'{}' has {} frames, expected {}", video.name, facts.frames, video.frames);
    // Images of odd size have one additional column or row in 4:2:0 videos.
    const auto fits = [](int got, std::int64_t stated) {
      return stated == 0 || got == stated || got == (stated + 1) / 2 * 2;
    };
    if (!fits(facts.width, video.width) || !fits(facts.height, video.height))
      return fmt::format("'{}' is {} x {} pixels, expected {} x {}", video.name, facts.width,
                         facts.height, video.width, video.height);
    if (video.crc.empty()) return "";
    if (const std::string crc = record::checksum_of(file.get()); crc != video.crc)
      return fmt::format("'{}' is damaged: its checksum is {}, expected {}", video.name, crc,
                         video.crc);
    return "";
  }

  // Whether the files of this house differ from those that were read.
  bool has_moved(const fs::path& house) const {
    const auto of_house = [&](const std::vector<RecordedFile>& files) {
      std::vector<fs::path> paths;
      for (const RecordedFile& file : files) {
        const fs::path folder = file.path.parent_path();
        if (folder / "" == house / "" || folder.parent_path() == house / record::kStagingDir)
          paths.push_back(file.path);
      }
      return paths;
    };
    try {
      return of_house(listed_) != of_house(recorded_files(house));
    } catch (const Error&) {  // the house no longer exists
      return true;
    }
  }

  // Removes the findings of unpublished episodes, because they may have been moved since.
  void forget_waiting(const fs::path& house) {
    for (const RecordedFile& file : listed_) {
      if (file.published || file.path.parent_path().parent_path() != house / record::kStagingDir)
        continue;
      std::erase_if(result_.findings,
                    [&](const Finding& f) { return f.context.starts_with(printable(file.name)); });
    }
  }

  void check_leftovers(const fs::path& house) {
    const std::string context = house.filename().string();
    if (fs::is_symlink(house / record::kStagingDir))
      return error(context, fmt::format("'{}' is a symbolic link, which is not followed",
                                        record::kStagingDir));
    if (const bool locked = record::is_locked(house); locked || has_moved(house)) {
      forget_waiting(house);
      return error(context, locked
                                ? "is being recorded: verify it again after the recording has ended"
                                : kChanged);
    }
    if (fs::exists(house / record::kStagingDir)) {
      const std::size_t waiting = record::finished_episodes(house).size();
      error(context, fmt::format("is unfinished: {} finished episodes wait to be published; resume "
                                 "the recording, or repair",
                                 waiting));
      return;  // an interrupted publication may already have moved some videos
    }
    for (const fs::directory_entry& entry : fs::directory_iterator(house)) {
      const fs::path& path = entry.path();
      if (path.filename() == record::kDamagedDir)
        note(context + "/" + record::kDamagedDir, "contains damaged episodes that were set aside");
      const bool video = path.extension() == ".mp4" || path.extension() == ".mkv";
      if (video && !used_.contains(path))
        note(context + "/" + path.filename().string(), "does not belong to an episode");
    }
  }

  VerifyOptions options_;
  VerifyResult result_;
  std::vector<RecordedFile> listed_;
  std::vector<VideoCheck> videos_;
  std::set<fs::path> used_;
  std::set<std::pair<fs::path, std::string>> archives_;  // folder and name
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
    out += fmt::format("{}: {} {}\n", f.error ? "error" : "note", f.context, f.text);
  out += fmt::format("{}: {} files, {} episodes, {} steps, {} videos",
                     ok() ? "intact" : "NOT intact", files, episodes, steps, videos);
  if (unpublished > 0) out += fmt::format(", {} episodes not published", unpublished);
  return out + "\n";
}

std::string VerifyResult::json() const {
  nlohmann::json j{{"ok", ok()},     {"files", files},   {"episodes", episodes},
                   {"steps", steps}, {"videos", videos}, {"unpublished", unpublished}};
  j["findings"] = nlohmann::json::array();
  for (const Finding& f : findings)
    j["findings"].push_back({{"error", f.error}, {"place", f.context}, {"text", f.text}});
  return j.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace mjsense::replay
