// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/recorded_house.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/os.h"
#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/recording_description.h"
#include "mjsense/record/recording_lock.h"
#include "mjsense/record/recording_plan.h"
#include "mjsense/record/staged_episode.h"

namespace fs = std::filesystem;

namespace mjsense::record {
namespace {

// Describes a published file: {"recording": text, "episodes": [0, 1 ...]}.
std::string describe_published(const Fd& published, const std::string& shown) {
  const hdf5::H5Lock lock;
  const hdf5::Id file = hdf5::open_file(os::path_of(published.get()), false, shown);
  nlohmann::json out{{"recording", hdf5::text_attribute(file, "recording")},
                     {"episodes", nlohmann::json::array()}};
  for (const std::string& trajectory : hdf5::children(file)) {
    if (trajectory.starts_with("traj_"))
      out["episodes"].push_back(
          hdf5::int_attribute(hdf5::open_group(file, trajectory), "episode", -1));
  }
  return out.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

// A number of a description, which may come from an untrusted file.
std::int64_t number_of(const nlohmann::json& description, const char* name) {
  constexpr std::int64_t kMaximum = std::int64_t{1} << 53;
  const bool valid = description.is_object() && description.contains(name) &&
                     description[name].is_number_integer() && description[name] >= 0 &&
                     description[name] <= kMaximum;
  return valid ? description[name].get<std::int64_t>() : 0;
}

std::vector<std::string> finished_names(const Folder& staging) {
  std::vector<std::string> names = staging.names();
  std::erase_if(names, [](const std::string& name) { return !episode_number(name, ""); });
  return names;
}

}  // namespace

bool is_description(const std::string& text) {
  const nlohmann::json json = parse_description(text);
  const auto number = [&](const char* name) {
    return json.contains(name) && json[name].is_number_integer() && json[name] > 0 &&
           json[name] <= std::numeric_limits<int>::max();
  };
  return json.is_object() && number("episodes") && number("batches") &&
         json["batches"] <= json["episodes"];
}

std::string read_whole(const Folder& folder, const char* name) {
  constexpr std::int64_t kMaxBytes = 1 << 24;
  try {
    const Fd file = open_plain(folder.fd(), name);
    std::string text(static_cast<std::size_t>(std::min(size_of(file), kMaxBytes)), '\0');
    const ssize_t n = pread(file.get(), text.data(), text.size(), 0);
    text.resize(std::max<ssize_t>(0, n));
    return text;
  } catch (const Error&) {
    return "";
  }
}

std::optional<std::int64_t> episode_number(const std::string& name, std::string_view suffix) {
  constexpr std::string_view kPrefix = "episode_";
  if (!name.starts_with(kPrefix) || !name.ends_with(suffix)) return {};
  const char* first = name.data() + kPrefix.size();
  const char* last = name.data() + name.size() - suffix.size();
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(first, last, number);
  if (error != std::errc{} || end != last) return {};
  return number;
}

std::vector<std::string> published_files(const Folder& house) {
  std::vector<std::string> files = house.names();
  std::erase_if(files, [](const std::string& name) {
    return !name.starts_with("trajectories_batch_") || !name.ends_with(".h5");
  });
  return files;
}

int batch_in(const std::string& name) {
  int batch = 0, batches = 0;
  const bool numbers =
      std::sscanf(name.c_str(), "trajectories_batch_%9d_of_%9d.h5", &batch, &batches) == 2;
  return numbers && batch >= 1 && name == batch_file(batch - 1, batches) ? batch : 0;
}

Published read_published(const Folder& house, const std::string& name) {
  const Fd file = open_plain(house.fd(), name);
  const std::string shown = house.display_path(name);
  const auto found =
      nlohmann::json::parse(hdf5::in_child(
                                shown, static_cast<std::uint64_t>(size_of(file)),
                                [&] { return describe_published(file, shown); }, 0, file.get()),
                            nullptr, false);
  Published published{.batch = batch_in(name)};
  if (found.is_object()) {
    published.recording = found.at("recording").get<std::string>();
    published.episodes = found.at("episodes").get<std::vector<std::int64_t>>();
  }
  return published;
}

RecordingStart start_in(const std::string& description) {
  const nlohmann::json json = parse_description(description);
  constexpr std::int64_t kMaxBatches = 1 << 30;
  return {number_of(json, "first_attempt"),
          static_cast<int>(std::min(number_of(json, "first_batch"), kMaxBatches))};
}

std::vector<std::int64_t> attempts_in(const std::string& description) {
  const nlohmann::json json = parse_description(description);
  const auto found = json.find("attempts");
  std::vector<std::int64_t> attempts;
  if (found == json.end()) return attempts;
  if (!found->is_array()) throw RuntimeError("'attempts' of the recording is not a list");
  for (const nlohmann::json& number : *found) {
    if (!number.is_number_unsigned() || number > std::numeric_limits<std::int32_t>::max() ||
        (!attempts.empty() && number <= attempts.back()))
      throw RuntimeError("'attempts' of the recording is not a list of ascending numbers");
    attempts.push_back(number.get<std::int64_t>());
  }
  return attempts;
}

std::string unfinished_recording(const Folder& staging) {
  std::string text = read_whole(staging, kDescription);
  const bool sound = is_description(text);
  // Every finished episode carries the same text with a checksum. If none agrees with
  // recording.json, that file was lost or changed.
  std::map<std::string, int> said;
  for (const std::string& episode : finished_names(staging)) {
    try {
      const std::string recording = read_staged(staging.open_dir(episode)).recording;
      if (!is_description(recording)) continue;
      if (sound && fingerprint_difference(recording, text).empty()) return text;
      ++said[recording];
    } catch (const Error&) {
      continue;
    }
  }
  if (said.empty()) return sound ? text : "";
  return std::ranges::max_element(said, {}, [](const auto& s) { return s.second; })->first;
}

std::vector<fs::path> finished_episodes(const fs::path& house) {
  std::vector<fs::path> found;
  if (!is_plain_folder(house / kStagingDir)) return found;
  const Folder staging = Folder::open(house / kStagingDir);
  for (const std::string& name : finished_names(staging)) found.push_back(staging.path() / name);
  return found;
}

RecordingStart start_after(const fs::path& house) {
  RecordingStart start;
  if (!fs::is_directory(house)) return start;
  const Folder folder = Folder::open(house);
  if (folder.find_dir(kStagingDir)) {
    throw ValueError(
        fmt::format("'{}' contains an unfinished recording; resume it before you append to it",
                    house.string()));
  }
  for (const std::string& name : published_files(folder)) {
    const Published file = read_published(folder, name);
    start.batch = std::max(start.batch, file.batch);
    for (const std::int64_t episode : file.episodes)
      start.attempt = std::max(start.attempt, episode + 1);
    const nlohmann::json description = parse_description(file.recording);
    start.attempt = std::max(start.attempt, number_of(description, "first_attempt") +
                                                number_of(description, "num_attempts"));
    const std::vector<std::int64_t> attempts = attempts_in(file.recording);
    if (!attempts.empty()) start.attempt = std::max(start.attempt, attempts.back() + 1);
  }
  return start;
}

RecordingStart start_of_last(const fs::path& house) {
  if (!fs::is_directory(house)) return {};
  const Folder folder = Folder::open(house);
  if (const Folder staging = folder.find_dir(kStagingDir)) {
    const std::string unfinished = unfinished_recording(staging);
    if (!unfinished.empty()) return start_in(unfinished);
  }
  Published last;
  for (const std::string& name : published_files(folder)) {
    Published file = read_published(folder, name);
    if (file.batch > last.batch) last = std::move(file);
  }
  return start_in(last.recording);
}

void remove_recordings(const fs::path& house) {
  if (!fs::is_directory(house)) return;
  const Folder folder = Folder::open(house);
  const Fd lock = lock_recording(folder, false);
  // First the HDF5 files, so that none of them names a video that is gone.
  std::vector<std::string> names = published_files(folder);
  for (const std::string& name : folder.names()) {
    const bool video = name.ends_with(".mp4") || name.ends_with(".mkv");
    if ((name.starts_with("episode_") && video) ||
        (name.starts_with("model_") && name.ends_with(".zip")))
      names.push_back(name);
  }
  for (const std::string& name : names) folder.remove(name);
  folder.remove(kDamagedDir);
  folder.remove(kStagingDir);
  folder.sync();
}

}  // namespace mjsense::record
