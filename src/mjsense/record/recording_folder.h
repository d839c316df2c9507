// SPDX-License-Identifier: Apache-2.0
#pragma once
// The directory of one house, as a small store that survives kill -9 at any moment:
//
//   trajectories_batch_1_of_2.h5, episode_*.mp4   published: whole, under their final names
//   .recording/recording.json                     what the recording is
//   .recording/lock                               held by the process that records
//   .recording/episode_00000007/                  finished, waits until its batch is whole
//   .recording/episode_00000008.discarded         attempted, not kept
//   .recording/episode_00000009.part.1234/        running in process 1234, worthless after it
//   damaged/episode_00000010/                     finished, found broken later: set aside
//
// Every change of state is one rename. A batch is published by moving videos first and the HDF5
// file last; when that is interrupted, doing it again ends in the same state, because the order of
// episodes is that of their numbers. All of them go through open directories (folder.h): when .recording
// is moved away or replaced by a link, the recording fails and nothing in the other folder changes. What an
// earlier process left is checked before it is published,
// and no name that stands in a file leads out of its folder.

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "mjsense/core/fd.h"
#include "mjsense/record/folder.h"
#include "mjsense/record/layout.h"
#include "mjsense/record/staged_episode.h"

namespace mjsense {

// Which attempts were decided, and how.
class Decisions {
 public:
  void add(std::int64_t episode, bool kept);  // once for each

  bool contains(std::int64_t episode) const { return kept_by_episode_.contains(episode); }
  int kept() const { return kept_; }
  int discarded() const { return static_cast<int>(kept_by_episode_.size()) - kept_; }
  // The kept episodes whose place no undecided attempt can take any more, in order.
  const std::vector<std::int64_t>& settled() const { return settled_; }
  // All kept episodes, in order.
  std::vector<std::int64_t> all_kept() const;

 private:
  std::map<std::int64_t, bool> kept_by_episode_;
  std::vector<std::int64_t> settled_;
  std::int64_t next_ = 0;  // the lowest that is undecided
  int kept_ = 0;
};

class RecordingFolder {
 public:
  // Opens or begins a recording. Throws ValueError when there is one and `resume` is false, or it
  // is a different one, or another process records into it; RuntimeError when the directory cannot
  // be written.
  RecordingFolder(const std::filesystem::path& dir, const std::string& fingerprint, bool resume);
  // A recording in which nothing was decided leaves nothing behind: what failed at its first step
  // blocks nobody.
  ~RecordingFolder();
  RecordingFolder(const RecordingFolder&) = delete;
  RecordingFolder& operator=(const RecordingFolder&) = delete;

  const std::filesystem::path& dir() const { return dir_.path(); }
  // An empty folder for the files of an episode.
  std::shared_ptr<const Folder> begin(std::int64_t episode);
  // Syncs that folder and makes it a finished episode.
  void keep(std::int64_t episode, const Folder& part);
  void discard(std::int64_t episode, const std::string& why);
  void abandon(std::int64_t episode);

  const Decisions& decisions() const { return decisions_; }
  bool ended() const { return ended_; }  // published; nothing more to record

  void publish_ready();  // the batches whose episodes are all decided
  void publish_all();    // also batches that lack episodes; ends the recording
  std::int64_t published_bytes() const { return published_bytes_; }
  // What was found broken, a sentence each: these attempts are undecided again.
  const std::vector<std::string>& damage() const { return damage_; }

 private:
  void load_published(const std::vector<std::string>& files, const std::string& fingerprint);
  void load_staged();
  void bring_back(const std::map<std::int64_t, StagedEpisode>& staged, bool ending);
  void set_aside(const std::string& name, const std::string& why);
  void publish(int batch, const std::vector<std::int64_t>& episodes);
  std::vector<std::int64_t> batch_of(int batch, const std::vector<std::int64_t>& kept) const;
  bool end();  // false: the folder that it recorded into is elsewhere now, and empty
  void end_or_throw();
  // Throws RuntimeError when the folders were moved or replaced since they were opened.
  void require_in_place() const;
  [[noreturn]] void throw_moved(const std::filesystem::path& path) const;

  Folder dir_, staging_;
  std::string fingerprint_;
  Batches batches_;
  std::set<int> published_;
  int next_batch_ = 0;  // those before it are published
  Decisions decisions_;
  std::vector<std::string> damage_;
  std::int64_t published_bytes_ = 0;
  bool ended_ = false;
  Fd lock_;
};

// The names under which a house keeps what is not published.
inline constexpr const char* kStagingDir = ".recording";
inline constexpr const char* kEpisodeFile = "traj.h5";
inline constexpr const char* kDamagedDir = "damaged";

// recording.json of a recording's folder (kStagingDir), or what most of its finished episodes say where
// that is lost or none of them agrees with it: "" when it holds no unfinished recording.
std::string unfinished_recording(const Folder& staging);
// Directories of finished, unpublished episodes, in order.
std::vector<std::filesystem::path> finished_episodes(const std::filesystem::path& house);

}  // namespace mjsense
