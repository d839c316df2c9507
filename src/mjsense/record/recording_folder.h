// SPDX-License-Identifier: Apache-2.0
#pragma once
// Storage of one house: a directory that survives kill -9 at any moment.
//
//   trajectories_batch_1_of_2.h5, episode_*.mp4   published: complete, under their final names
//   .recording/recording.json                     description of the recording
//   .recording/lock                               held by the process that records
//   .recording/episode_00000007/                  finished; waits until its batch is complete
//   .recording/episode_00000008.discarded         attempted, not kept
//   .recording/episode_00000009.part.1234/        running in process 1234; useless after it ends
//   damaged/episode_00000010/                     finished, but found damaged later
//
// Every change of state is one rename. To publish a batch, the videos are moved first and the HDF5
// file last. If publishing is interrupted, repeating it reaches the same state, because episodes
// are ordered by their numbers. All renames go through open directories (folder.h): if .recording
// is moved away or replaced by a symbolic link, the recording fails and nothing in the other
// directory changes. Files that an earlier process left are checked before they are published, and
// no name inside a file can lead out of its folder.

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "mjsense/core/files/file_descriptor.h"
#include "mjsense/record/decisions.h"
#include "mjsense/record/folder.h"
#include "mjsense/record/recorded_house.h"
#include "mjsense/record/recording_plan.h"
#include "mjsense/record/staged_episode.h"

namespace mjsense::record {

class RecordingFolder {
 public:
  // Opens or creates a recording. Throws ValueError if there is one and `resume` is false, if it
  // has another fingerprint, or if another process records into it. Throws RuntimeError if the
  // directory cannot be written. The completed recordings that this one continues, if any,
  // must have the same settings.
  RecordingFolder(const std::filesystem::path& dir, const std::string& fingerprint, bool resume);
  // Removes the recording if nothing was decided, so that a run that failed at its first step does
  // not block later ones.
  ~RecordingFolder();
  RecordingFolder(const RecordingFolder&) = delete;
  RecordingFolder& operator=(const RecordingFolder&) = delete;

  const std::filesystem::path& dir() const { return dir_.path(); }
  // Creates an empty folder for the files of an episode.
  std::shared_ptr<const Folder> begin(std::int64_t episode);
  // Syncs that folder and renames it to a finished episode.
  void keep(std::int64_t episode, const Folder& part);
  void discard(std::int64_t episode, const std::string& why);
  void abandon(std::int64_t episode);

  // Stores a file that all episodes share; a file of this name is complete already.
  void store(const std::string& name, std::string_view bytes);

  const Decisions& decisions() const { return decisions_; }
  // Everything is published; nothing can be recorded any more.
  bool ended() const { return ended_; }

  void publish_ready();  // publishes the batches whose episodes are all decided
  void publish_all();    // publishes incomplete batches too and ends the recording
  std::int64_t published_bytes() const { return published_bytes_; }
  // Damaged episodes, one sentence each. They are undecided again.
  const std::vector<std::string>& damage() const { return damage_; }

 private:
  void load_published(const std::vector<std::string>& files, const std::string& fingerprint);
  void load_staged();
  void bring_back(const std::map<std::int64_t, StagedEpisode>& staged);
  void set_aside(const std::string& name, const std::string& why);
  void publish(int batch, const std::vector<std::int64_t>& episodes, bool ending);
  void mark_ending();
  // Whether a published file belongs to a recording that this one continues.
  bool is_continued(const std::string& name) const;
  std::string file_of(int batch) const;
  std::vector<std::int64_t> batch_of(int batch, const std::vector<std::int64_t>& kept) const;
  bool end();  // false: the recording's folder was moved elsewhere and is empty
  void end_or_throw();
  // Throws RuntimeError if the folders were moved or replaced after they were opened.
  void require_in_place() const;
  [[noreturn]] void throw_moved(const std::filesystem::path& path) const;

  Folder dir_, staging_;
  std::string fingerprint_;
  Batches batches_;
  std::int64_t first_attempt_ = 0;
  int first_batch_ = 0;
  std::set<int> published_;
  int next_batch_ = 0;  // batches before it are published
  Decisions decisions_;
  std::vector<std::string> damage_;
  std::int64_t published_bytes_ = 0;
  bool ended_ = false;
  std::string stored_;  // name of the file that store() has written
  Fd lock_;
};

}  // namespace mjsense::record
