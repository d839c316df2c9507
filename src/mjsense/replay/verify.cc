// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/recorded_house.h"
#include "mjsense/record/recording_lock.h"
#include "mjsense/record/sha256.h"
#include "mjsense/record/video_file.h"
#include "mjsense/replay/file_verifier.h"
#include "mjsense/replay/recording_tools.h"
#include "mjsense/replay/trajectory.h"
#include "mjsense/replay/video_probe.h"

namespace fs = std::filesystem;

namespace mjsense::replay {
namespace {

using Json = nlohmann::json;

constexpr const char* kChanged = "changed while it was being read: verify it again";

struct VideoCheck {
  std::string context;
  fs::path folder;
  std::string name;
  std::int64_t frames = 0;
  std::int64_t width = 0, height = 0;  // 0: unknown
  std::string crc;                     // "" if unknown
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
          return verify_file(recorded, bytes, seal != record::Seal::kNone);
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
      return fmt::format("'{}' has {}, expected {}", video.name, counted(facts.frames, "frame"),
                         video.frames);
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
      error(context,
            fmt::format("is unfinished: {} not yet published; resume the recording, or repair",
                        counted(waiting, "finished episode")));
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
  std::map<std::string, int> notes;  // a note about many episodes is one line
  for (const Finding& f : findings) {
    if (!f.error) ++notes[f.text];
  }
  for (const Finding& f : findings) {
    if (f.error) {
      out += fmt::format("error: {} {}\n", f.context, f.text);
    } else if (const auto same = notes.extract(f.text)) {
      out += fmt::format("note: {} {}", f.context, f.text);
      if (same.mapped() > 1) out += fmt::format(" (and {} more)", same.mapped() - 1);
      out += "\n";
    }
  }
  out += fmt::format("{}: {}, {}, {}, {}", ok() ? "intact" : "NOT intact", counted(files, "file"),
                     counted(episodes, "episode"), counted(steps, "observation"),
                     counted(videos, "video"));
  if (unpublished > 0) out += fmt::format(", {} not published", counted(unpublished, "episode"));
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
