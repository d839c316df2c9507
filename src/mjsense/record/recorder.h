// SPDX-License-Identifier: Apache-2.0
#pragma once
// Records episodes to HDF5 and video files while they run.
//
//   Recorder recorder(cfg);                     opens or resumes {out}/house_{id}/
//   recorder.begin_episode(w, {episode, seed});
//   recorder.append(w, {reward, ...});          once per observation: row w of every sensor
//   recorder.finish_episode(w, obs_scene);      kept
//   recorder.discard_episode(w, why);           or: attempted, not kept
//   recorder.complete();                        publishes everything, ends the recording
//
// append() copies its input and returns. One thread feeds the encoders and one writes HDF5. Memory
// does not grow with the length of an episode: if an encoder or the disk is slower than the
// simulation, append() waits. No frame is ever dropped.
//
// Crash safety: an episode is written into {house}/.recording/episode_N.part. Once all its files
// are complete and on disk, one rename makes it {house}/.recording/episode_N. Once all attempts up
// to the end of a batch are decided, the batch is published: videos are moved to their final names,
// then the HDF5 file. At any moment a finished episode is readable in one of the two places, and a
// new Recorder with cfg.resume continues from there.
//
// A fault (disk full, ffmpeg killed, text truncated) throws one RuntimeError or ValueError from the
// next call, with the file and the reason. Calls for different worlds may come from different
// threads.

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/record/recording.h"

namespace mjsense::record {

// Time and bytes that a recording has used so far.
struct RecordStats {
  std::int64_t rows = 0;             // observations of all worlds
  std::int64_t frames = 0;           // video frames of all cameras
  std::int64_t raw_bytes = 0;        // bytes of rows and frames in the sensors' format
  std::int64_t published_bytes = 0;  // files under their final names
  double copy_s = 0;                 // append(): copying rows and frames
  double wait_s = 0;                 // append(), begin_episode(): waiting for encoders or the disk
  double write_s = 0;                // writer thread: compressing and writing HDF5
  double commit_s = 0;               // writer thread: syncing, renaming, publishing
  double encode_cpu_s = 0;           // processor time of the ffmpeg programs
};

class Recorder {
 public:
  // Validates the streams, their paths, the output directory and ffmpeg. Throws ValueError or
  // RuntimeError.
  explicit Recorder(const RecordingCfg& cfg);
  // Abandons running episodes, which can be attempted again. Finished episodes are kept.
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  void begin_episode(int world, const EpisodeMeta& meta);
  // The sensors' rows of `world` must be up to date. Throws ValueError if a dict row contains
  // truncated text; the caller must then discard the episode.
  void append(int world, const StepRow& row);
  // `obs_scene`: JSON text. `outcome`: a word or a sentence, stored as an attribute. `arrays`:
  // further data for replay, such as the model's arrays in which the episode differs from
  // cfg.archive.
  void finish_episode(int world, std::string_view obs_scene, std::string_view outcome = "",
                      std::vector<EpisodeArray> arrays = {});
  // Adds the data of a recorded episode, before finish_episode().
  void carry_over(int world, EpisodeSource source);
  // Marks the attempt as decided but not kept: a resumed recording does not repeat it.
  void discard_episode(int world, std::string_view why = "");
  // The same for an attempt that was not begun.
  void skip_episode(std::int64_t episode, std::string_view why);
  // Leaves the attempt undecided: a resumed recording repeats it.
  void abandon_episode(int world);

  [[nodiscard]] bool recording(int world) const;
  // True if this attempt was finished or discarded, now or before the recording was resumed.
  [[nodiscard]] bool decided(std::int64_t episode) const;
  int kept() const;   // episodes finished so far, published or not
  int saved() const;  // those of them that are completely on disk and safe from later faults
  // Number of the first attempt. It is not that of the configuration if the recording continues
  // others of the same folder.
  std::int64_t first_attempt() const;
  // Episodes of an earlier process that were found damaged, one sentence each. They were moved
  // aside and are attempted again.
  [[nodiscard]] std::vector<std::string> damage() const;
  int discarded() const;
  // True if cfg.episodes are kept and no earlier attempt is undecided.
  [[nodiscard]] bool has_all_episodes() const;

  // Waits until every finished episode is safe on disk.
  void flush();
  // Calls flush(), then publishes all batches, incomplete ones too, and removes {house}/.recording.
  // No episode can be recorded afterwards.
  void complete();

  std::filesystem::path house_dir() const;
  RecordStats stats() const;
  std::size_t bytes_per_world() const;  // memory for buffers and queues

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mjsense::record
