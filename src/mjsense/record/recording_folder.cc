// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/recording_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/system/os.h"
#include "mjsense/hdf5/untrusted_file.h"
#include "mjsense/record/checksum.h"
#include "mjsense/record/recording_description.h"
#include "mjsense/record/recording_lock.h"
#include "mjsense/record/recording_plan.h"

namespace fs = std::filesystem;

namespace mjsense::record {
namespace {

constexpr const char* kEndingFile = "ending";  // publish_all() has begun to publish

void make_dir(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) throw_file("create the directory", path, error.value());
}

std::string episode_name(std::int64_t episode) { return fmt::format("episode_{:08d}", episode); }

std::string part_name(std::int64_t episode) {
  // The process id prevents conflicts with the files of an encoder that outlives a killed recording
  // for a moment.
  return fmt::format("{}.part.{}", episode_name(episode), getpid());
}

// A video to be moved from an episode's folder to the house.
struct Move {
  std::string episode, name, final_name;
};

// A description without the numbers in which recordings of the same settings may differ.
std::string settings_of(const std::string& description) {
  nlohmann::json json = parse_description(description);
  if (!json.is_object()) return "";
  for (const char* count :
       {"episodes", "batches", "first_attempt", "num_attempts", "attempts", "first_batch"})
    json.erase(count);
  return json.dump();
}

// Writes the final names of an episode's videos into the file, and appends the moves that this
// requires.
void name_videos(hid_t trajectory, std::int64_t number, std::vector<Move>& moves) {
  const hdf5::Id names = hdf5::open_group(trajectory, "obs/sensor_data");
  for (const StagedVideo& video : staged_videos(trajectory)) {
    const std::string final_name = video_file(number, video.name);
    std::array<char, kFileNameBytes> bytes{};
    std::memcpy(bytes.data(), final_name.data(), std::min(final_name.size(), bytes.size()));
    const hdf5::Id dataset = hdf5::open_dataset(names, video.key);
    if (hdf5::dims(dataset) != std::vector<hsize_t>{kFileNameBytes})
      throw RuntimeError(fmt::format("'{}' is not a one-dimensional array of {} bytes", video.key,
                                     kFileNameBytes));
    hdf5::check(H5Dwrite(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()),
                video.key);
    moves.push_back({episode_name(number), video.name, final_name});
  }
}

}  // namespace

RecordingFolder::RecordingFolder(const fs::path& dir, const std::string& fingerprint, bool resume)
    : fingerprint_(fingerprint) {
  if (!is_description(fingerprint))
    throw RuntimeError(fmt::format("'{}': the description of the recording cannot be read",
                                   (dir / kStagingDir / kDescription).string()));
  const nlohmann::json description = parse_description(fingerprint);
  batches_ = batches_of(description.at("episodes"), description.at("batches"));
  first_attempt_ = start_in(fingerprint).attempt;
  first_batch_ = start_in(fingerprint).batch;
  decisions_ = Decisions(first_attempt_, attempts_in(fingerprint));

  make_dir(dir);
  dir_ = Folder::open(dir);
  // First, because a process that holds the lock may still publish.
  lock_ = lock_recording(dir_, false);
  staging_ = dir_.find_dir(kStagingDir);
  const std::vector<std::string> published = published_files(dir_);
  const bool any_published =
      !std::ranges::all_of(published, [&](const std::string& name) { return is_continued(name); });
  if (resume || !any_published) load_published(published, fingerprint);
  const std::string unfinished = staging_ ? unfinished_recording(staging_) : "";
  if (!resume && (any_published || !unfinished.empty())) {
    throw ValueError(fmt::format(
        "'{}' already contains {}; {}, or choose another directory", dir.string(),
        any_published ? "recorded trajectories" : "an unfinished recording",
        any_published ? "resume it, append to it, overwrite it" : "resume it, overwrite it"));
  }
  if (const std::string difference =
          unfinished.empty() ? "" : fingerprint_difference(unfinished, fingerprint);
      !difference.empty()) {
    throw ValueError(
        fmt::format("'{}' contains a different recording: {}", dir.string(), difference));
  }
  // A lock file without kEndingFile means that the recording continues, even if recording.json was
  // lost.
  const bool goes_on = lock_ && !staging_.contains(kEndingFile);
  if (unfinished.empty() && any_published && !goes_on) {
    ended_ = true;
    // Remove what a process that was killed in its last step left.
    if (lock_) staging_.remove(kLockFile);
    if (staging_ && staging_.contains(kEndingFile)) dir_.remove(kStagingDir, staging_);
    lock_.reset();
    return;
  }
  if (!staging_) staging_ = dir_.make_dir(kStagingDir);
  if (!lock_) {
    lock_ = lock_recording(dir_, true);
    // Another process may have recorded between the reads above and the acquisition of the lock.
    if (unfinished != unfinished_recording(staging_) || published != published_files(dir_))
      throw ValueError(fmt::format("another process is recording into '{}'", dir.string()));
  }
  if (!staging_.contains(kLockFile, lock_)) throw_moved(staging_.path());
  if (read_whole(staging_, kDescription) != fingerprint)
    staging_.write(kDescription, unfinished.empty() ? fingerprint : unfinished);
  load_staged();
  if (staging_.contains(kEndingFile)) publish_all();
  if (!ended_ && static_cast<int>(published_.size()) == batches_.count) end_or_throw();
}

RecordingFolder::~RecordingFolder() {
  const bool decided = decisions_.kept() + decisions_.discarded() > 0;
  if (ended_ || !published_.empty() || decided) return;
  if (!stored_.empty()) dir_.remove(stored_);
  end();
  if (dir_.is_at_its_path()) rmdir(dir_.path().c_str());  // fails if it is not empty
}

void RecordingFolder::require_in_place() const {
  if (!dir_.is_at_its_path()) throw_moved(dir_.path());
  if (!dir_.contains(kStagingDir, staging_)) throw_moved(staging_.path());
}

void RecordingFolder::throw_moved(const fs::path& path) const {
  throw RuntimeError(
      fmt::format("'{}' was moved, removed or replaced during the recording; its finished episodes "
                  "are in the folder that had this name: move it back and resume",
                  path.string()));
}

void RecordingFolder::load_published(const std::vector<std::string>& files,
                                     const std::string& fingerprint) {
  for (const std::string& name : files) {
    const Published file = read_published(dir_, name);
    const std::string difference =
        file.recording.empty() ? "it was not recorded by mjsense"
        : is_continued(name)
            ? fingerprint_difference(settings_of(file.recording), settings_of(fingerprint))
            : fingerprint_difference(file.recording, fingerprint);
    if (!difference.empty()) {
      throw ValueError(fmt::format("'{}' belongs to a different recording: {}",
                                   dir_.display_path(name), difference));
    }
    if (is_continued(name)) continue;
    const int batch = file.batch - 1 - first_batch_;
    if (batch >= 0 && name == file_of(batch)) published_.insert(batch);
    for (const std::int64_t episode : file.episodes) decisions_.add(episode, true);
  }
}

bool RecordingFolder::is_continued(const std::string& name) const {
  return batch_in(name) >= 1 && batch_in(name) <= first_batch_;
}

std::string RecordingFolder::file_of(int batch) const {
  return batch_file(first_batch_ + batch, first_batch_ + batches_.count);
}

// Moves the videos of an interrupted publication back. Afterwards every episode is either complete
// in its folder or damaged.
void RecordingFolder::bring_back(const std::map<std::int64_t, StagedEpisode>& staged) {
  for (const auto& [number, episode] : staged) {
    const Folder home = staging_.open_dir(episode_name(number));
    for (const StagedVideo& video : episode.videos) {
      const std::string away = video_file(number, video.name);
      if (!home.contains(video.name) && dir_.is_plain_file(away))
        dir_.rename(away, home, video.name);
    }
  }
}

void RecordingFolder::set_aside(const std::string& name, const std::string& why) {
  Folder damaged = dir_.find_dir(kDamagedDir);
  if (!damaged) damaged = dir_.make_dir(kDamagedDir);
  std::string to = name;
  for (int n = 2; damaged.contains(to); ++n) to = fmt::format("{}.{}", name, n);
  staging_.rename(name, damaged, to);
  damaged.sync();
  damage_.push_back(
      fmt::format("{} {}; it was set aside as '{}'", name, why, damaged.display_path(to)));
}

void RecordingFolder::load_staged() {
  std::map<std::int64_t, StagedEpisode> staged;
  for (const std::string& name : staging_.names()) {
    if (name == kLockFile || name == kDescription || name == kEndingFile) continue;
    const auto finished = episode_number(name, ""), discarded = episode_number(name, ".discarded");
    if (finished && !decisions_.contains(*finished)) {
      try {
        if (name != episode_name(*finished))
          throw RuntimeError("is not a valid name for an episode's folder");
        StagedEpisode episode = read_staged(staging_.open_dir(name));
        const std::string difference = fingerprint_difference(episode.recording, fingerprint_);
        if (!difference.empty())
          throw RuntimeError("belongs to a different recording: " + difference);
        staged.emplace(*finished, std::move(episode));
      } catch (const hdf5::ReaderInterrupted&) {
        throw;
      } catch (const Error& e) {
        set_aside(name, e.what());
      }
    } else if (discarded) {
      decisions_.add(*discarded, false);
    } else {
      staging_.remove(name);
    }
  }
  bring_back(staged);
  for (const auto& [number, episode] : staged) {
    const std::string name = episode_name(number);
    try {
      check_staged_videos(staging_.open_dir(name), episode);
      decisions_.add(number, true);
    } catch (const Error& e) {
      set_aside(name, e.what());
    }
  }
}

void RecordingFolder::store(const std::string& name, std::string_view bytes) {
  require_in_place();
  if (dir_.is_plain_file(name)) return;
  dir_.write(name, bytes);
  stored_ = name;
}

std::shared_ptr<const Folder> RecordingFolder::begin(std::int64_t episode) {
  require_in_place();
  const std::string part = part_name(episode);
  staging_.remove(part);
  // The folder must be new: one that another process created may contain symbolic links.
  return std::make_shared<const Folder>(staging_.make_dir(part));
}

void RecordingFolder::keep(std::int64_t episode, const Folder& part) {
  require_in_place();
  for (const std::string& file : part.names()) part.sync(file);
  part.sync();
  const std::string name = part_name(episode);
  if (!staging_.contains(name, part)) throw_moved(part.path());
  staging_.rename(name, staging_, episode_name(episode));
  staging_.sync();
  decisions_.add(episode, true);
}

void RecordingFolder::discard(std::int64_t episode, const std::string& why) {
  require_in_place();
  staging_.write(episode_name(episode) + ".discarded", why);
  staging_.sync();
  staging_.remove(part_name(episode));
  decisions_.add(episode, false);
}

void RecordingFolder::abandon(std::int64_t episode) { staging_.remove(part_name(episode)); }

std::vector<std::int64_t> RecordingFolder::batch_of(int batch,
                                                    const std::vector<std::int64_t>& kept) const {
  const auto maximum = static_cast<std::int64_t>(kept.size());
  const std::int64_t first = std::min(batches_.first(batch), maximum),
                     last = std::min(batches_.first(batch + 1), maximum);
  return {kept.begin() + first, kept.begin() + last};
}

void RecordingFolder::publish_ready() {
  const std::vector<std::int64_t>& kept = decisions_.settled();
  for (; next_batch_ < batches_.count &&
         batches_.first(next_batch_ + 1) <= static_cast<std::int64_t>(kept.size());
       ++next_batch_) {
    if (!published_.contains(next_batch_)) publish(next_batch_, batch_of(next_batch_, kept), false);
  }
}

void RecordingFolder::publish_all() {
  if (ended_) return;
  publish_ready();
  const std::vector<std::int64_t> kept = decisions_.all_kept();
  for (int b = next_batch_; b < batches_.count; ++b) {
    const std::vector<std::int64_t> episodes = batch_of(b, kept);
    if (episodes.empty()) break;
    if (!published_.contains(b)) publish(b, episodes, true);
  }
  require_in_place();
  if (kept.empty() && !stored_.empty()) dir_.remove(stored_);  // no episode refers to it
  mark_ending();
  end_or_throw();
}

// From here on the order of episodes is final, also for a process that resumes after an
// interruption.
void RecordingFolder::mark_ending() {
  if (staging_.contains(kEndingFile)) return;
  staging_.write(kEndingFile, "");
  staging_.sync();
}

void RecordingFolder::publish(int batch, const std::vector<std::int64_t>& episodes, bool ending) {
  require_in_place();
  const std::string part = "batch.part";
  const std::string what = fmt::format("cannot write '{}'", staging_.display_path(part));
  // If writing fails, incomplete files are removed to free their disk space. Their episodes stay
  // staged.
  struct Removed {
    const Folder& folder;
    const std::string& name;
    ~Removed() { folder.remove(name); }
  } const removed{staging_, part};
  std::vector<Move> moves;
  {
    const hdf5::H5Lock lock;
    hdf5::Id file = hdf5::create_file(staging_.fd_path(part), staging_.display_path(part));
    std::int64_t maximum =
        1 << 17;  // margin for the file's contents apart from its episodes, bytes
    for (const std::int64_t episode : episodes)
      maximum += staging_.open_dir(episode_name(episode)).size_of(kEpisodeFile) * 9 / 8;
    staging_.reserve_space(part, maximum);
    hdf5::set_attribute(file, "format", "mjsense 1");
    hdf5::set_attribute(file, "recording", fingerprint_);
    for (std::size_t i = 0; i < episodes.size(); ++i) {
      const std::string name = fmt::format("traj_{}", i);
      const Folder staged = staging_.open_dir(episode_name(episodes[i]));
      const Fd bytes = open_plain(staged.fd(), kEpisodeFile);
      hdf5::Id source =
          hdf5::open_file(os::path_of(bytes.get()), false, staged.display_path(kEpisodeFile));
      hdf5::check(
          H5Ocopy(source, "traj_0", file, name.c_str(), H5P_DEFAULT, hdf5::link_properties()),
          what);
      const hdf5::Id trajectory = hdf5::open_group(file, name);
      name_videos(trajectory, episodes[i], moves);
    }
    file.close(what);
  }
  seal_file(staging_, part);
  staging_.sync(part);
  if (ending) mark_ending();  // not earlier: if the disk is full, the recording may continue
  for (const Move& move : moves) {
    // A missing video was already moved by an earlier, interrupted publication.
    const Folder staged = staging_.open_dir(move.episode);
    if (staged.contains(move.name) || !dir_.contains(move.final_name))
      staged.rename(move.name, dir_, move.final_name);
    published_bytes_ += dir_.size_of(move.final_name);
  }
  dir_.sync();
  const std::string final_name = file_of(batch);
  staging_.rename(part, dir_, final_name);
  dir_.sync();
  published_.insert(batch);
  published_bytes_ += dir_.size_of(final_name);
  for (const std::int64_t episode : episodes) staging_.remove(episode_name(episode));
}

bool RecordingFolder::end() {
  ended_ = true;
  if (!staging_) return true;
  for (const std::string& name : staging_.names()) {
    if (name == kDescription || name == kLockFile || name == kEndingFile) continue;
    // This episode exceeds the wanted number. It is renamed first, because a half-removed one would
    // look damaged.
    const std::string dropped = name + ".part";
    const bool renamed = renameat(staging_.fd(), name.c_str(), staging_.fd(), dropped.c_str()) == 0;
    staging_.remove(renamed ? dropped : name);
  }
  // The files that mark the recording as unfinished are removed last.
  staging_.remove(kDescription);
  staging_.remove(kLockFile);
  lock_.reset();
  return dir_.remove(kStagingDir, staging_) && dir_.is_at_its_path();
}

void RecordingFolder::end_or_throw() {
  if (!end()) throw_moved(dir_.is_at_its_path() ? staging_.path() : dir_.path());
}

}  // namespace mjsense::record
