// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/recording_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "mjsense/core/error.h"
#include "mjsense/core/plain_file.h"
#include "mjsense/hdf5/guard.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/description.h"
#include "mjsense/record/durable.h"
#include "mjsense/record/layout.h"
#include "mjsense/record/recording_lock.h"

namespace fs = std::filesystem;

namespace mjsense {
namespace {

constexpr const char* kEndingFile = "ending";  // publish_all() has begun
constexpr const char* kDescription = "recording.json";

void make_dir(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) throw_file("create the directory", path, error.value());
}

// A file of ours, which is short; "" if it is none.
std::string read_whole(const fs::path& folder, const char* name) {
  constexpr std::int64_t kMostBytes = 1 << 24;
  try {
    const Fd file = open_plain(folder, name);
    std::string text(static_cast<std::size_t>(std::min(size_of(file), kMostBytes)), '\0');
    const ssize_t n = pread(file.get(), text.data(), text.size(), 0);
    text.resize(std::max<ssize_t>(0, n));
    return text;
  } catch (const Error&) {
    return "";
  }
}

// Throws where a name of ours is a link to a place that we would write to.
void require_no_link(const fs::path& path) {
  struct stat about = {};
  if (lstat(path.c_str(), &about) != 0) {
    if (errno != ENOENT && errno != ENOTDIR) throw_file("write", path, errno);
    return;
  }
  if (S_ISLNK(about.st_mode))
    throw ValueError(
        fmt::format("'{}' is a link, which is not followed: remove it", path.string()));
}

// What the recording of this house must be if it is to be published: JSON text of our own making.
bool is_description(const std::string& text) {
  const nlohmann::json json = parse_description(text);
  const auto number = [&](const char* name) {
    return json.contains(name) && json[name].is_number_integer() && json[name] > 0 &&
           json[name] <= std::numeric_limits<int>::max();
  };
  return json.is_object() && number("episodes") && number("batches") &&
         json["batches"] <= json["episodes"];
}

void remove_tree(const fs::path& path) {
  std::error_code ignored;  // a leftover under a temporary name harms nobody
  fs::remove_all(path, ignored);
}

std::string episode_name(std::int64_t episode) { return fmt::format("episode_{:08d}", episode); }

// "episode_00000007" + suffix -> 7
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

std::vector<fs::path> entries(const fs::path& dir) {
  std::vector<fs::path> paths;
  std::error_code error;
  for (fs::directory_iterator it(dir, error), end; !error && it != end; it.increment(error))
    paths.push_back(it->path());
  std::sort(paths.begin(), paths.end());
  return paths;
}

std::vector<fs::path> published_files(const fs::path& house) {
  std::vector<fs::path> files = entries(house);
  std::erase_if(files, [](const fs::path& path) {
    return !path.filename().string().starts_with("trajectories_batch_") ||
           path.extension() != ".h5";
  });
  return files;
}

using Moves = std::vector<std::pair<fs::path, fs::path>>;

// {"recording": text, "episodes": [0, 1 ...]} of a published file.
std::string describe_published(const fs::path& path) {
  const h5::H5Lock lock;
  const h5::Id file = h5::open_file(path);
  nlohmann::json out{{"recording", h5::text_attribute(file, "recording")},
                     {"episodes", nlohmann::json::array()}};
  for (const std::string& trajectory : h5::children(file)) {
    if (trajectory.starts_with("traj_"))
      out["episodes"].push_back(h5::int_attribute(h5::open_group(file, trajectory), "episode", -1));
  }
  return out.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string final_name_of(const StagedVideo& video, int index, int batch, int batches) {
  const fs::path name = video.name;
  return video_file(name.stem().string(), name.extension().string(), index, batch, batches);
}

// Writes the final names of the videos of traj_{index} into the file, and notes what has to be
// moved where.
void name_videos(hid_t trajectory, const fs::path& staged, const fs::path& house, int index,
                 int batch, int batches, Moves& moves) {
  const h5::Id names = h5::open_group(trajectory, "obs/sensor_data");
  for (const StagedVideo& video : staged_videos(trajectory)) {
    const std::string final_name = final_name_of(video, index, batch, batches);
    std::array<char, kFileNameBytes> bytes{};
    std::memcpy(bytes.data(), final_name.data(), std::min(final_name.size(), bytes.size()));
    const h5::Id dataset = h5::open_dataset(names, video.key);
    if (h5::dims(dataset) != std::vector<hsize_t>{kFileNameBytes})
      throw RuntimeError(fmt::format("'{}' is no row of {} bytes", video.key, kFileNameBytes));
    h5::check(H5Dwrite(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()),
              video.key);
    moves.emplace_back(staged / video.name, house / final_name);
  }
}

}  // namespace

void Decisions::add(std::int64_t episode, bool kept) {
  if (!kept_by_episode_.emplace(episode, kept).second) return;
  kept_ += kept;
  for (auto at = kept_by_episode_.find(next_); at != kept_by_episode_.end() && at->first == next_;
       ++at, ++next_) {
    if (at->second) settled_.push_back(next_);
  }
}

std::vector<std::int64_t> Decisions::all_kept() const {
  std::vector<std::int64_t> episodes;
  for (const auto& [episode, is_kept] : kept_by_episode_) {
    if (is_kept) episodes.push_back(episode);
  }
  return episodes;
}

RecordingFolder::RecordingFolder(const fs::path& dir, const std::string& fingerprint, bool resume)
    : dir_(dir), staging_(dir / kStagingDir), fingerprint_(fingerprint) {
  if (!is_description(fingerprint))
    throw RuntimeError(fmt::format("'{}': its description of a recording cannot be read",
                                   (staging_ / kDescription).string()));
  const nlohmann::json description = parse_description(fingerprint);
  batches_ = batches_of(description.at("episodes"), description.at("batches"));

  require_no_link(staging_);
  lock_ = lock_recording(dir, false);  // first: who holds it still publishes
  const std::vector<fs::path> published = published_files(dir);
  const bool any_published = !published.empty();
  load_published(published, fingerprint);
  const std::string unfinished = unfinished_recording(dir);
  if (!resume && (any_published || !unfinished.empty())) {
    throw ValueError(
        fmt::format("'{}' already holds {}; resume it, or choose another directory", dir.string(),
                    any_published ? "recorded trajectories" : "an unfinished recording"));
  }
  if (const std::string difference =
          unfinished.empty() ? "" : fingerprint_difference(unfinished, fingerprint);
      !difference.empty()) {
    throw ValueError(fmt::format("'{}' holds a different recording: {}", dir.string(), difference));
  }
  // A lock without the mark of the end: it goes on, though recording.json was lost.
  const bool goes_on = lock_ && !fs::exists(staging_ / kEndingFile);
  if (unfinished.empty() && any_published && !goes_on) {
    ended_ = true;
    // What a process killed in its last step left.
    if (lock_) remove_tree(staging_ / kLockFile);
    if (unlink((staging_ / kEndingFile).c_str()) == 0) rmdir(staging_.c_str());
    lock_.reset();
    return;
  }
  make_dir(staging_);
  if (!lock_) {
    lock_ = lock_recording(dir, true);
    // Whether somebody came and went between our reading and our lock.
    if (unfinished != unfinished_recording(dir) || published != published_files(dir))
      throw ValueError(fmt::format("another process records into '{}'", dir.string()));
  }
  if (read_whole(staging_, kDescription) != fingerprint)
    write_whole(staging_ / kDescription, unfinished.empty() ? fingerprint : unfinished);
  load_staged();
  if (fs::exists(staging_ / kEndingFile)) publish_all();
  if (!ended_ && static_cast<int>(published_.size()) == batches_.count) end();
}

RecordingFolder::~RecordingFolder() {
  const bool decided = decisions_.kept() + decisions_.discarded() > 0;
  if (ended_ || !published_.empty() || decided) return;
  end();
  std::error_code not_empty;
  fs::remove(dir_, not_empty);
}

void RecordingFolder::load_published(const std::vector<fs::path>& files,
                                     const std::string& fingerprint) {
  for (const fs::path& path : files) {
    const std::string name = path.filename().string();
    const auto bytes = static_cast<std::uint64_t>(size_of(open_plain(dir_, name)));
    const auto found = nlohmann::json::parse(
        h5::in_child(path.string(), bytes, [&] { return describe_published(path); }), nullptr,
        false);
    const std::string was = found.is_object() ? found.at("recording").get<std::string>() : "";
    const auto difference =
        was.empty() ? "it was not recorded by mjsense" : fingerprint_difference(was, fingerprint);
    if (!difference.empty()) {
      throw ValueError(
          fmt::format("'{}' belongs to a different recording: {}", path.string(), difference));
    }
    int batch = 0, batches = 0;
    if (std::sscanf(name.c_str(), "trajectories_batch_%d_of_%d.h5", &batch, &batches) == 2 &&
        batch >= 1 && batch <= batches_.count && name == batch_file(batch - 1, batches_.count))
      published_.insert(batch - 1);
    for (const std::int64_t episode : found.at("episodes")) decisions_.add(episode, true);
  }
}

// Moves videos back that an interrupted publication had moved already: then every episode is whole
// in its folder or it is not, and one that is not takes nothing from the others.
void RecordingFolder::bring_back(const std::map<std::int64_t, StagedEpisode>& staged, bool ending) {
  Decisions then = decisions_;
  for (const auto& [episode, found] : staged) then.add(episode, true);
  const std::vector<std::int64_t> order = ending ? then.all_kept() : then.settled();
  int batch = 0;
  for (std::size_t at = 0; at < order.size(); ++at) {
    const auto found = staged.find(order[at]);
    if (found == staged.end()) continue;
    while (batch + 1 < batches_.count && batches_.first(batch + 1) <= static_cast<std::int64_t>(at))
      ++batch;
    const int index = static_cast<int>(static_cast<std::int64_t>(at) - batches_.first(batch));
    for (const StagedVideo& video : found->second.videos) {
      const fs::path home = staging_ / episode_name(found->first) / video.name,
                     away = dir_ / final_name_of(video, index, batch, batches_.count);
      if (!published_.contains(batch) && !fs::exists(home) && is_plain_file(away))
        rename_file(away, home);
    }
  }
}

void RecordingFolder::set_aside(const fs::path& folder, const std::string& why) {
  const fs::path damaged = dir_ / kDamagedDir;
  require_no_link(damaged);
  make_dir(damaged);
  fs::path to = damaged / folder.filename();
  for (int n = 2; fs::exists(fs::symlink_status(to)); ++n)
    to = damaged / fmt::format("{}.{}", folder.filename().string(), n);
  rename_file(folder, to);
  sync_file(damaged);
  damage_.push_back(
      fmt::format("{} {}; it was set aside as '{}'", folder.filename().string(), why, to.string()));
}

void RecordingFolder::load_staged() {
  std::map<std::int64_t, StagedEpisode> staged;
  const bool ending = fs::exists(staging_ / kEndingFile);
  for (const fs::path& path : entries(staging_)) {
    const std::string name = path.filename().string();
    if (name == kLockFile || name == kDescription || name == kEndingFile) continue;
    const auto finished = episode_number(name, ""), discarded = episode_number(name, ".discarded");
    if (finished && !decisions_.contains(*finished)) {
      try {
        if (name != episode_name(*finished))
          throw RuntimeError("is not how an episode's folder is named");
        StagedEpisode episode = read_staged(path);
        const std::string difference = fingerprint_difference(episode.recording, fingerprint_);
        if (!difference.empty())
          throw RuntimeError("belongs to a different recording: " + difference);
        staged.emplace(*finished, std::move(episode));
      } catch (const h5::Ended&) {
        throw;
      } catch (const Error& e) {
        set_aside(path, e.what());
      }
    } else if (discarded) {
      decisions_.add(*discarded, false);
    } else {
      remove_tree(path);
    }
  }
  bring_back(staged, ending);
  for (const auto& [number, episode] : staged) {
    const fs::path folder = staging_ / episode_name(number);
    try {
      check_staged_videos(folder, episode);
      decisions_.add(number, true);
    } catch (const Error& e) {
      set_aside(folder, e.what());
    }
  }
}

fs::path RecordingFolder::part_dir(std::int64_t episode) const {
  // The process number keeps us from the files of an encoder that outlives a killed recording by a
  // moment.
  return staging_ / fmt::format("{}.part.{}", episode_name(episode), getpid());
}

void RecordingFolder::begin(std::int64_t episode) {
  remove_tree(part_dir(episode));
  // It must be new: a folder that somebody else put there may hold links.
  if (mkdir(part_dir(episode).c_str(), 0755) != 0)
    throw_file("create the directory", part_dir(episode), errno);
}

void RecordingFolder::keep(std::int64_t episode) {
  const fs::path part = part_dir(episode);
  for (const fs::path& file : entries(part)) sync_file(file);
  sync_file(part);
  rename_file(part, staging_ / episode_name(episode));
  sync_file(staging_);
  decisions_.add(episode, true);
}

void RecordingFolder::discard(std::int64_t episode, const std::string& why) {
  write_whole(staging_ / (episode_name(episode) + ".discarded"), why);
  sync_file(staging_);
  remove_tree(part_dir(episode));
  decisions_.add(episode, false);
}

void RecordingFolder::abandon(std::int64_t episode) { remove_tree(part_dir(episode)); }

std::vector<std::int64_t> RecordingFolder::batch_of(int batch,
                                                    const std::vector<std::int64_t>& kept) const {
  const auto most = static_cast<std::int64_t>(kept.size());
  const std::int64_t first = std::min(batches_.first(batch), most),
                     last = std::min(batches_.first(batch + 1), most);
  return {kept.begin() + first, kept.begin() + last};
}

void RecordingFolder::publish_ready() {
  const std::vector<std::int64_t>& kept = decisions_.settled();
  for (; next_batch_ < batches_.count &&
         batches_.first(next_batch_ + 1) <= static_cast<std::int64_t>(kept.size());
       ++next_batch_) {
    if (!published_.contains(next_batch_)) publish(next_batch_, batch_of(next_batch_, kept));
  }
}

void RecordingFolder::publish_all() {
  if (ended_) return;
  publish_ready();
  // From here on the order of episodes is settled, also for a process that finds us interrupted.
  write_whole(staging_ / kEndingFile, "");
  sync_file(staging_);
  const std::vector<std::int64_t> kept = decisions_.all_kept();
  for (int b = next_batch_; b < batches_.count; ++b) {
    const std::vector<std::int64_t> episodes = batch_of(b, kept);
    if (episodes.empty()) break;
    if (!published_.contains(b)) publish(b, episodes);
  }
  end();
}

void RecordingFolder::publish(int batch, const std::vector<std::int64_t>& episodes) {
  const int batches = batches_.count;
  const fs::path part = staging_ / "batch.part";
  const std::string what = fmt::format("cannot write '{}'", part.string());
  // What could not be written whole leaves its disk space to others; its episodes wait as before.
  struct Removed {
    const fs::path& path;
    ~Removed() { unlink(path.c_str()); }
  } const removed{part};
  Moves moves;
  {
    const h5::H5Lock lock;
    h5::Id file = h5::create_file(part);
    std::int64_t most = 1 << 17;  // what a file has beside its episodes, and then some
    for (const std::int64_t episode : episodes)
      most += static_cast<std::int64_t>(
          fs::file_size(staging_ / episode_name(episode) / kEpisodeFile) * 9 / 8);
    reserve_space(part, most);
    h5::set_attribute(file, "format", "mjsense 1");
    h5::set_attribute(file, "recording", fingerprint_);
    for (std::size_t i = 0; i < episodes.size(); ++i) {
      const fs::path staged = staging_ / episode_name(episodes[i]);
      const std::string name = fmt::format("traj_{}", i);
      h5::Id source = h5::open_file(staged / kEpisodeFile);
      h5::check(H5Ocopy(source, "traj_0", file, name.c_str(), H5P_DEFAULT, h5::link_properties()),
                what);
      const h5::Id trajectory = h5::open_group(file, name);
      name_videos(trajectory, staged, dir_, static_cast<int>(i), batch, batches, moves);
    }
    file.close(what);
  }
  seal_file(part);
  sync_file(part);
  for (const auto& [from, to] : moves) {
    // A missing one was moved before an earlier attempt to publish was interrupted.
    if (std::rename(from.c_str(), to.c_str()) != 0 && (errno != ENOENT || !fs::exists(to)))
      throw_file("write", to, errno);
    published_bytes_ += static_cast<std::int64_t>(fs::file_size(to));
  }
  sync_file(dir_);
  const fs::path final_path = dir_ / batch_file(batch, batches);
  rename_file(part, final_path);
  sync_file(dir_);
  published_.insert(batch);
  published_bytes_ += static_cast<std::int64_t>(fs::file_size(final_path));
  for (const std::int64_t episode : episodes) remove_tree(staging_ / episode_name(episode));
}

void RecordingFolder::end() {
  ended_ = true;
  for (const fs::path& path : entries(staging_)) {
    const fs::path name = path.filename();
    if (name == kDescription || name == kLockFile || name == kEndingFile) continue;
    // An episode beyond the wanted number: half removed under its own name it would look damaged.
    const fs::path dropped = path.string() + ".part";
    std::error_code error;
    fs::rename(path, dropped, error);
    remove_tree(error ? path : dropped);
  }
  // The mark that says it has ended goes last.
  remove_tree(staging_ / kDescription);
  remove_tree(staging_ / kLockFile);
  lock_.reset();
  remove_tree(staging_);
}

std::string unfinished_recording(const fs::path& house) {
  const fs::path staging = house / kStagingDir;
  if (!is_plain_folder(staging)) return "";
  const std::string text = read_whole(staging, kDescription);
  const bool sound = is_description(text);
  // Every finished episode carries the same text, with a checksum: where none agrees with
  // recording.json, it is that which was lost or changed.
  std::map<std::string, int> said;
  for (const fs::path& episode : finished_episodes(house)) {
    try {
      const std::string recording = read_staged(episode).recording;
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
  for (const fs::path& path : entries(house / kStagingDir)) {
    if (episode_number(path.filename().string(), "")) found.push_back(path);
  }
  return found;
}

}  // namespace mjsense
