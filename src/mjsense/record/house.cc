// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/house.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "mjsense/core/error.h"
#include "mjsense/hdf5/h5.h"
#include "mjsense/record/layout.h"

namespace fs = std::filesystem;

namespace mjsense {
namespace {

constexpr const char* kEndingFile = "ending";  // publish_all() has begun

[[noreturn]] void throw_file(const char* deed, const fs::path& path, int error) {
  throw RuntimeError(fmt::format("cannot {} '{}': {}", deed, path.string(), std::strerror(error)));
}

void sync(const fs::path& path) {
  const Fd fd(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd || fsync(fd.get()) != 0) throw_file("sync", path, errno);
}

void move(const fs::path& from, const fs::path& to) {
  if (std::rename(from.c_str(), to.c_str()) != 0) throw_file("write", to, errno);
}

void make_dir(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) throw_file("create the directory", path, error.value());
}

void write_whole(const fs::path& path, std::string_view text) {
  const fs::path part = path.string() + ".part";
  {
    const Fd fd(open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
    if (!fd || write(fd.get(), text.data(), text.size()) != static_cast<ssize_t>(text.size()) ||
        fsync(fd.get()) != 0) {
      const int error = errno;
      unlink(part.c_str());
      throw_file("write", path, error);
    }
  }
  move(part, path);
}

std::string read_whole(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
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

using Moves = std::vector<std::pair<fs::path, fs::path>>;

// Writes the final names of the videos of traj_{index} into the file, and notes what has to be
// moved where.
void name_videos(hid_t trajectory, const fs::path& staged, const fs::path& house, int index,
                 int batch, int batches, Moves& moves) {
  const h5::Id names(H5Gopen2(trajectory, "obs/sensor_data", H5P_DEFAULT), H5Gclose,
                     "obs/sensor_data");
  for (const std::string& key : h5::children(names)) {
    const h5::Id dataset(H5Dopen2(names, key.c_str(), H5P_DEFAULT), H5Dclose, key);
    char name[kFileNameBytes + 1] = {};
    h5::check(H5Dread(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, name), key);
    const fs::path staged_name = name;
    const std::string final_name = video_file(
        staged_name.stem().string(), staged_name.extension().string(), index, batch, batches);
    std::memset(name, 0, sizeof name);
    std::memcpy(name, final_name.data(), std::min(final_name.size(), kFileNameBytes));
    h5::check(H5Dwrite(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, name), key);
    moves.emplace_back(staged / staged_name, house / final_name);
  }
}

}  // namespace

int Decisions::kept() const {
  return static_cast<int>(std::count_if(kept_by_episode.begin(), kept_by_episode.end(),
                                        [](const auto& d) { return d.second; }));
}

std::vector<std::int64_t> Decisions::first(int most, bool settled) const {
  std::vector<std::int64_t> episodes;
  std::int64_t next = 0;
  for (const auto& [episode, is_kept] : kept_by_episode) {
    if (settled && episode != next++) break;
    if (is_kept && static_cast<int>(episodes.size()) < most) episodes.push_back(episode);
  }
  return episodes;
}

House::House(const fs::path& dir, const std::string& fingerprint, bool resume)
    : dir_(dir), staging_(dir / kStagingDir), fingerprint_(fingerprint) {
  const auto description = nlohmann::json::parse(fingerprint);
  episodes_ = description.at("episodes");
  batch_sizes_ = batch_sizes(episodes_, description.at("batches"));
  published_.resize(batch_sizes_.size());

  const bool any_published = load_published(fingerprint);
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
  if (unfinished.empty() && any_published) {
    ended_ = true;
    return;
  }
  make_dir(staging_);
  const fs::path lock = staging_ / "lock";
  lock_ = Fd(open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (!lock_) throw_file("write", lock, errno);
  // The second question: whether it came to its end between our reading and our lock.
  if (flock(lock_.get(), LOCK_EX | LOCK_NB) != 0 || unfinished != unfinished_recording(dir)) {
    throw ValueError(fmt::format("another process records into '{}'", dir.string()));
  }
  load_staged();
  if (unfinished.empty()) write_whole(staging_ / "recording.json", fingerprint);
  if (fs::exists(staging_ / kEndingFile)) publish_all();
  if (!ended_ && std::all_of(published_.begin(), published_.end(), [](bool p) { return p; })) end();
}

House::~House() {
  const bool published = std::ranges::any_of(published_, [](bool p) { return p; });
  if (ended_ || published || !decisions_.kept_by_episode.empty()) return;
  end();
  std::error_code not_empty;
  fs::remove(dir_, not_empty);
}

bool House::load_published(const std::string& fingerprint) {
  bool any = false;
  for (const fs::path& path : entries(dir_)) {
    const std::string name = path.filename().string();
    if (!name.starts_with("trajectories_batch_") || path.extension() != ".h5") continue;
    any = true;
    const h5::H5Lock lock;
    const h5::Id file = h5::open_file(path);
    const std::string was = h5::text_attribute(file, "recording");
    const auto difference =
        was.empty() ? "it was not recorded by mjsense" : fingerprint_difference(was, fingerprint);
    if (!difference.empty()) {
      throw ValueError(
          fmt::format("'{}' belongs to a different recording: {}", path.string(), difference));
    }
    for (std::size_t b = 0; b < batch_sizes_.size(); ++b) {
      if (name == batch_file(static_cast<int>(b), static_cast<int>(batch_sizes_.size())))
        published_[b] = true;
    }
    for (const std::string& trajectory : h5::children(file)) {
      if (!trajectory.starts_with("traj_")) continue;
      const h5::Id group(H5Gopen2(file, trajectory.c_str(), H5P_DEFAULT), H5Gclose, trajectory);
      decisions_.kept_by_episode[h5::int_attribute(group, "episode", -1)] = true;
    }
  }
  return any;
}

void House::load_staged() {
  const bool known = fs::exists(staging_ / "recording.json");
  for (const fs::path& path : entries(staging_)) {
    const std::string name = path.filename().string();
    if (name == "lock" || name == "recording.json" || (known && name == kEndingFile)) continue;
    const auto finished = episode_number(name, ""), discarded = episode_number(name, ".discarded");
    // Without recording.json this is the rest of a directory that was being removed.
    if (known && finished && !decisions_.contains(*finished)) {
      decisions_.kept_by_episode[*finished] = true;
    } else if (known && discarded) {
      decisions_.kept_by_episode[*discarded] = false;
    } else {
      remove_tree(path);
    }
  }
}

fs::path House::part_dir(std::int64_t episode) const {
  // The process number keeps us from the files of an encoder that outlives a killed recording by a
  // moment.
  return staging_ / fmt::format("{}.part.{}", episode_name(episode), getpid());
}

void House::begin(std::int64_t episode) {
  remove_tree(part_dir(episode));
  make_dir(part_dir(episode));
}

void House::keep(std::int64_t episode) {
  const fs::path part = part_dir(episode);
  for (const fs::path& file : entries(part)) sync(file);
  sync(part);
  move(part, staging_ / episode_name(episode));
  sync(staging_);
  decisions_.kept_by_episode[episode] = true;
}

void House::discard(std::int64_t episode, const std::string& why) {
  write_whole(staging_ / (episode_name(episode) + ".discarded"), why);
  sync(staging_);
  remove_tree(part_dir(episode));
  decisions_.kept_by_episode[episode] = false;
}

void House::abandon(std::int64_t episode) { remove_tree(part_dir(episode)); }

std::vector<std::int64_t> House::batch_of(int batch, const std::vector<std::int64_t>& kept) const {
  std::size_t first = 0;
  for (int b = 0; b < batch; ++b) first += batch_sizes_[b];
  const std::size_t last = std::min(first + batch_sizes_[batch], kept.size());
  if (first >= last) return {};
  return {kept.begin() + static_cast<std::ptrdiff_t>(first),
          kept.begin() + static_cast<std::ptrdiff_t>(last)};
}

void House::publish_ready() {
  const std::vector<std::int64_t> kept = decisions_.first(episodes_, true);
  for (std::size_t b = 0; b < batch_sizes_.size(); ++b) {
    const std::vector<std::int64_t> episodes = batch_of(static_cast<int>(b), kept);
    if (!published_[b] && static_cast<int>(episodes.size()) == batch_sizes_[b])
      publish(static_cast<int>(b), episodes);
  }
}

void House::publish_all() {
  if (ended_) return;
  publish_ready();
  // From here on the order of episodes is settled, also for a process that finds us interrupted.
  write_whole(staging_ / kEndingFile, "");
  sync(staging_);
  const std::vector<std::int64_t> kept = decisions_.first(episodes_, false);
  for (std::size_t b = 0; b < batch_sizes_.size(); ++b) {
    const std::vector<std::int64_t> episodes = batch_of(static_cast<int>(b), kept);
    if (!published_[b] && !episodes.empty()) publish(static_cast<int>(b), episodes);
  }
  end();
}

void House::publish(int batch, const std::vector<std::int64_t>& episodes) {
  const int batches = static_cast<int>(batch_sizes_.size());
  const fs::path part = staging_ / "batch.part";
  const std::string what = fmt::format("cannot write '{}'", part.string());
  Moves moves;
  {
    const h5::H5Lock lock;
    h5::Id file = h5::create_file(part);
    h5::set_attribute(file, "format", "mjsense 1");
    h5::set_attribute(file, "recording", fingerprint_);
    for (std::size_t i = 0; i < episodes.size(); ++i) {
      const fs::path staged = staging_ / episode_name(episodes[i]);
      const std::string name = fmt::format("traj_{}", i);
      h5::Id source = h5::open_file(staged / kEpisodeFile);
      h5::check(H5Ocopy(source, "traj_0", file, name.c_str(), H5P_DEFAULT, h5::link_properties()),
                what);
      h5::Id trajectory(H5Gopen2(file, name.c_str(), H5P_DEFAULT), H5Gclose, name);
      name_videos(trajectory, staged, dir_, static_cast<int>(i), batch, batches, moves);
    }
    file.close(what);
  }
  sync(part);
  for (const auto& [from, to] : moves) {
    // A missing one was moved before an earlier attempt to publish was interrupted.
    if (std::rename(from.c_str(), to.c_str()) != 0 && (errno != ENOENT || !fs::exists(to)))
      throw_file("write", to, errno);
    published_bytes_ += static_cast<std::int64_t>(fs::file_size(to));
  }
  sync(dir_);
  const fs::path final_path = dir_ / batch_file(batch, batches);
  move(part, final_path);
  sync(dir_);
  published_[batch] = true;
  published_bytes_ += static_cast<std::int64_t>(fs::file_size(final_path));
  for (const std::int64_t episode : episodes) remove_tree(staging_ / episode_name(episode));
}

void House::end() {
  ended_ = true;
  for (const fs::path& path : entries(staging_)) {
    const fs::path name = path.filename();
    if (name != "recording.json" && name != "lock" && name != kEndingFile) remove_tree(path);
  }
  remove_tree(staging_ / "recording.json");  // before the mark that says it has ended
  lock_.reset();
  remove_tree(staging_);
}

std::string unfinished_recording(const fs::path& house) {
  return read_whole(house / kStagingDir / "recording.json");
}

std::vector<fs::path> finished_episodes(const fs::path& house) {
  std::vector<fs::path> found;
  for (const fs::path& path : entries(house / kStagingDir)) {
    if (episode_number(path.filename().string(), "") && fs::exists(path / kEpisodeFile))
      found.push_back(path);
  }
  return found;
}

}  // namespace mjsense
